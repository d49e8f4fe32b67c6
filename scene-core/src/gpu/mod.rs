//! The GPU half: techniques record into the caller's encoder and write the caller's view.
//!
//! | module | what it holds |
//! | --- | --- |
//! | [`technique`] | the trait's GPU half and what techniques are given |
//! | [`scene`] | geometry in buffers, its upload and bind groups |
//! | [`gbuffer`] | the G-buffer pass |
//! | [`depth`] | the shadow-depth pass |
//! | [`chosen`] | triangles that a pass before chooses for it |
//! | [`layers`] | depth maps as layers of one texture |
//! | [`caster_tree`] | the casters' tree, as shaders walk it |
//! | [`receivers`] | camera, light and G-buffer, as shaders read them |
//! | [`visibility`] | the full-screen pass that writes V |
//! | [`compute`] | compute passes and the buffers they write |
//! | [`layout`] | uniforms of cameras and lights |
//! | [`held`] | buffers and bind groups kept from frame to frame |
//! | [`timing`] | the recorder, time per stage |
//! | [`shaders`] | the linked WGSL |
//! | [`adapter`], [`readback`], [`headless`] | a device without a window, reading back, a whole frame |
//! | [`testing`] | a device for tests, a runner for shader functions |
//!
//! # In somebody else's frame
//! Nothing but the three headless modules creates a device, submits work, waits or reads back. A technique lives in
//! a renderer's own frame: device, encoder, depth pre-pass and lighting pass are the renderer's, textures and
//! buffers too, and their formats are stated per field. Everything fits WebGPU's default limits and asks for no
//! feature; timestamps are used where the device has them.
//!
//! # Shared WGSL
//! `shaders/*.wesl` of this crate are WESL modules: `scene_core::camera`, `light`, `sampling`, `gbuffer`, `scene`,
//! `cutout`, `receivers`, `receiver_plane` and `full_screen` are imported by technique crates at build time (crate
//! `gnomon-shader-build` says how and why); so are `light_views`, `depths`, `texel_plane`, `light_cone` and `pixel_hash`,
//! what lookups in the maps of `gnomon-shadow-map` consist of: their Rust twins lie in that crate. `shadow_rays` traces,
//! with `caster_tree`, `shadow_origin` and the `predicates` that decide where f32 cannot. Bind groups have fixed places: 0 is the pass's own, 1 the scene's triangles,
//! 2 its cut-outs, 3 the receivers and the light.

pub mod adapter;
pub mod caster_tree;
pub mod chosen;
pub mod compute;
pub mod depth;
mod error;
pub mod gbuffer;
pub mod headless;
pub mod held;
pub mod layers;
pub mod layout;
pub mod pages;
mod pipeline;
pub mod readback;
pub mod receivers;
pub mod scene;
pub mod shaders;
pub mod storage;
pub mod technique;
pub mod testing;
pub mod timing;
pub mod visibility;

pub use adapter::Gpu;
pub use caster_tree::{CasterNode, CasterTrees};
pub use chosen::{ChosenRuns, RUN};
pub use compute::{ComputePass, WorkBuffer};
pub use depth::{DepthIds, DepthPass, DepthTarget, WrittenProjection};
pub use error::GpuError;
pub use gbuffer::{GBufferPass, GBufferTargets, GpuGBuffer};
pub use headless::{HeadlessError, HeadlessFrame, HeadlessRun, HeadlessView};
pub use held::{Bound, HeldBuffer, HeldGroup, HeldGroups, binding};
pub use layers::DepthLayers;
pub use layout::{CameraUniform, DepthUniform, LightUniform};
pub use pages::{Pages, Readers};
pub use pipeline::{RenderPipelineParts, render_pipeline, shader_module};
pub use receivers::Receivers;
pub use scene::{
    GeometryBuffers, GpuCutouts, GpuObject, GpuScene, SceneBindings, SceneBuffers, SceneGroups, SceneHandles,
};
pub use storage::{binding_limit, filled_buffer, pieces, storage_buffer, table_buffer};
pub use technique::{GpuShadowQuery, GpuShadowTechnique};
pub use timing::{Recorder, StageSpan, StageTimer};
pub use visibility::{VisibilityPass, VisibilityPassParts};
