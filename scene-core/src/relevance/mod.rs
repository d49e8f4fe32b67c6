//! What light and camera make irrelevant: one home for every skip, and one rule. *Skipping never changes the
//! image*, and what is skipped is counted in the [`Report`](crate::Report).
//!
//! | question | answer |
//! | --- | --- |
//! | which casters can shadow what is seen? | [`CasterRegion`], [`relevant_casters`] |
//! | which of them, for one cascade or face of a cube? | [`Receivers::inside`], [`depth_slice`], [`pyramid`] |
//! | which receivers does the light reach, and a part of its maps? | [`reached_receivers`], [`objects_among`] |
//! | which casters have nothing behind them? | [`told_apart`], [`told_apart_with_solids`] |
//! | where is what a tile of the image sees? | [`TileBounds`] |
//! | which tiles need no filter, being lit or in umbra? | [`classify_tiles`] |
//! | what stays valid from the frame before? | [`what_remains`] |

mod backdrops;
mod casters;
mod classes;
mod close_bounds;
mod extent;
mod object_groups;
mod polyhedron;
mod receiver_group;
mod receivers;
mod region;
mod sheet;
mod tiles;
mod validity;
mod volumes;

pub use backdrops::{Backdrops, MOST_OF_A_SOLID, told_apart, told_apart_with_solids};
pub use casters::{CasterChunks, RelevantCasters, relevant_casters};
pub use classes::{TileClasses, classify_tiles};
pub use close_bounds::{LITTLE, MOST_TRIANGLES};
pub use extent::reach_of;
pub use polyhedron::{HalfSpace, Polyhedron, Side};
pub use receivers::{Receivers, objects_among, reached_receivers};
pub use region::CasterRegion;
pub use tiles::{TILE, Tile, TileBounds, TileClass};
pub use validity::{Change, Remake, what_remains};
pub use volumes::{depth_slice, pyramid};
