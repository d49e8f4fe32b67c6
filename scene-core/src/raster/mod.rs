//! The CPU rasteriser: depth from any projection, and the G-buffer.
//!
//! | function | what it draws |
//! | --- | --- |
//! | [`render_depth`], [`render_depth_into`] | nearest depth of the casters, as a shadow map holds it |
//! | [`render_depth_and_triangles_into`], [`render_depth_and_objects_into`] | the same, and which triangle or object is nearest |
//! | [`render_gbuffer`] | what a camera sees of all objects |
//! | [`count_layers`] | front and back faces over every pixel |
//! | [`render_fragments`] | every face over every pixel, in order of depth |
//!
//! # How it works
//! 1. Vertices are projected once, in f64, and snapped to 1/256 pixel (`projection`).
//! 2. Sixteen triangles at a time, those that cover no pixel centre are dropped and the rest is sorted into
//!    bands of rows (`bins`); what crosses the near or far plane, the eye's plane or the guard band is clipped
//!    in homogeneous coordinates (`clip`).
//! 3. A thread owns a band. Small triangles are set up sixteen at once and tested lane by lane
//!    (`small`); larger ones are cut into rows whose ends an exact integer DDA yields (`spans`).
//!
//! # Coverage
//! A pixel is covered if its centre lies inside the snapped triangle, decided in integers with the top-left
//! rule: along a shared edge no pixel is covered twice and none is missed, whatever the mesh, and also where
//! both triangles are clipped. All faces are drawn, front and back, unless [`Cull`] says otherwise. An object
//! with a cut-out mask covers a pixel where the mask is solid at the perspective-correct texture coordinate.
//!
//! # Precision of depth
//! A stored depth is, up to rounding, the exact depth of a point of the triangle whose projection lies at most
//! 2⁻⁹ pixel in x and in y from the pixel's centre. This holds for slivers and for triangles seen edge-on too,
//! because depth is interpolated by exact integer weights of the snapped corners, never extrapolated: it stays
//! between the depths of the corners. Rounding adds at most 7·2⁻²⁴ of the depth range of the triangle's
//! corners, plus 16·2⁻²⁴ of the change of depth from a pixel to the next, plus an ulp of the depth itself
//! and half an ulp of each corner's. [`DEPTH_POSITION_ERROR`] and [`depth_error`] say the same in code: biases
//! derive from them.
//!
//! # Determinism
//! The result does not depend on the number of threads, nor on the vector instructions the processor has, bit
//! for bit: no operation is fused, none is reordered, and where two surfaces are equally near the triangle
//! with the lower index is the one that is seen.
//!
//! # Limits
//! Sides up to 16,384 pixels. Positions and matrices may be as large as f32 holds: projection and clipping are
//! done in f64, where no product of theirs overflows; a cut is exact to about 2⁻⁵⁰ of its triangle's extent. A matrix with NaN or infinite entries draws nothing.

mod bins;
mod clip;
mod cutout;
mod depth;
mod draw;
mod fragments;
mod gbuffer;
mod layers;
mod pixels;
mod projection;
mod small;
mod snapped;
mod spans;

pub use depth::{
    Cull, DEPTH_POSITION_ERROR, DepthConvention, DepthMap, DepthOptions, DepthRange, depth_error,
    render_depth, render_depth_and_objects_into, render_depth_and_triangles_into, render_depth_into,
};
pub use draw::RasterScratch;
pub use fragments::{Fragment, Fragments, render_fragments};
pub use gbuffer::{render_gbuffer, render_gbuffer_with};
pub use layers::{LayerCounts, count_layers};
pub use snapped::SnappedView;

/// The longest side of a target in pixels.
pub const MAX_SIDE: u32 = crate::Camera::MAX_SIDE;
