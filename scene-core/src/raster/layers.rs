//! Depth complexity: how many faces lie over each pixel.

use glam::Mat4;
use rayon::prelude::*;

use super::MAX_SIDE;
use super::bins::BAND_ROWS;
use super::depth::Cull;
use super::draw::{Drawing, RasterScratch, draw};
use super::pixels::CountPixels;
use super::projection::Projection;
use crate::Scene;

/// Faces over each pixel, row by row from the top left.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LayerCounts {
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Front faces (corners counter-clockwise as seen).
    pub front: Vec<u32>,
    /// Back faces.
    pub back: Vec<u32>,
}

/// Counts the faces of all objects over every pixel's centre, whatever their depth; only what lies behind the
/// eye is left out. Over a closed mesh, wholly before the eye, both counts are equal at every pixel.
///
/// Projection, limits and panics are those of [`render_depth`](super::render_depth).
///
/// # Panics
/// If a side is longer than [`MAX_SIDE`].
pub fn count_layers(scene: &Scene, clip_from_world: Mat4, width: u32, height: u32) -> LayerCounts {
    assert!(width <= MAX_SIDE && height <= MAX_SIDE, "a side of {width} × {height} is above {MAX_SIDE}");
    let pixels = width as usize * height as usize;
    let mut counts = LayerCounts { width, height, front: vec![0; pixels], back: vec![0; pixels] };
    let band = (width as usize * BAND_ROWS).max(1);
    let bands = counts.front.par_chunks_mut(band).zip(counts.back.par_chunks_mut(band));
    let drawing = Drawing {
        scene,
        projection: Projection::new(&clip_from_world.as_dmat4(), width, height, true),
        width,
        height,
        cull: Cull::None,
        clamp: true,
        window: [0..width as i32, 0..height as i32],
    };
    let all = scene.objects().iter().zip(0..).map(|(o, id)| (o.triangles.clone(), id));
    draw(&drawing, all, &mut RasterScratch::new(), bands.map(|(front, back)| CountPixels { front, back }));
    counts
}
