//! What light and camera make irrelevant: one home for every skip, and one rule. *Skipping never changes the
//! image*, and what is skipped is counted in the [`Report`](crate::Report).
//!
//! | question | answer |
//! | --- | --- |
//! | which casters can shadow what is seen? | [`CasterRegion`], [`relevant_casters`] |
//! | which receivers does the light reach? | [`reached_receivers`] |
//! | which casters have nothing behind them? | [`told_apart`] |
//! | where is what a tile of the image sees? | [`TileBounds`] |
//! | what stays valid from the frame before? | [`what_remains`] |

mod backdrops;
mod casters;
mod extent;
mod polyhedron;
mod receivers;
mod region;
mod tiles;
mod validity;

pub use backdrops::{Backdrops, told_apart};
pub use casters::{CasterChunks, RelevantCasters, relevant_casters};
pub use extent::reach_of;
pub use polyhedron::{HalfSpace, Polyhedron, Side};
pub use receivers::{Receivers, reached_receivers};
pub use region::CasterRegion;
pub use tiles::{TILE, Tile, TileBounds, TileClass};
pub use validity::{Change, Remake, what_remains};
