//! A picket fence that is one box with a cut-out mask, on a slab: the Fence scene of Cherry and Kooima's
//! "Multi-pass Gaussian Contact-hardening Soft Shadows" (table 1: 16 vertices, 24 triangles, 2 meshes).

use std::sync::Arc;

use glam::{Vec2, Vec3};

use super::shapes::cuboid;
use super::spec::Values;
use super::{BuiltIn, Counts, Parameter, Stage, camera};
use crate::Light;
use crate::geometry::{AlphaMask, Wrap};

pub(super) const SCENE: BuiltIn = BuiltIn {
    name: "fence",
    summary: "a picket fence cut from one box by an alpha mask: shadows from hard at the foot to soft at the tips",
    parameters: &[
        Parameter::whole("pickets", 16, [1, 256], "pickets of the fence"),
        Parameter::real("light", 0.45, [0.01, 2.0], "half the side of the square light, in metres"),
    ],
    counts: Some(Counts { vertices: 16, triangles: 24, meshes: 2 }),
    build,
};

const LENGTH: f32 = 4.0;
const HEIGHT: f32 = 1.1;
const THICKNESS: f32 = 0.03;

fn build(values: &Values<'_>, _time: f32) -> Stage {
    let half = values.real("light");
    let center = Vec3::new(-1.3, 3.7, -4.0);
    let u = Vec3::Y.cross(center).normalize() * half;
    let light = Light::Rect { center, half_u: u, half_v: u.cross(center.normalize()) };
    let mut stage =
        Stage::new(camera(Vec3::new(-0.6, 2.6, 5.4), Vec3::new(0.05, 0.3, 0.7), 44.0, 0.1), light);
    stage.add("ground", cuboid(Vec3::new(-4.0, -0.1, -4.0), Vec3::new(4.0, 0.0, 4.0)));

    let (x, z) = (LENGTH * 0.5, THICKNESS * 0.5);
    let mut fence = cuboid(Vec3::new(-x, 0.0, -z), Vec3::new(x, HEIGHT, z));
    // Front and back share their coordinates; ends, top and bottom fall on the mask's border texels.
    fence.uvs = fence.positions.iter().map(|p| Vec2::new(p.x / LENGTH + 0.5, 1.0 - p.y / HEIGHT)).collect();
    fence.alpha = mask(values.whole("pickets"));
    stage.add("fence", fence);
    stage
}

/// Pickets with pointed tips and two rails, one texel a centimetre or finer.
fn mask(pickets: u32) -> Option<Arc<AlphaMask>> {
    let per_picket = 32.max(512 / pickets);
    let (width, height) = (pickets * per_picket, 256);
    let solid = |x: u32, y: u32| {
        // Within its share of the fence a picket takes the middle half; up is where v is 0.
        let across = ((x % per_picket) as f32 + 0.5) / per_picket as f32;
        let up = 1.0 - (y as f32 + 0.5) / height as f32;
        let from_middle = (across - 0.5).abs();
        // 0.07 of the height for the tip's half width of 0.27: about 45 degrees at 16 pickets.
        let tip = 1.0 - 0.26 * from_middle;
        let rail = (0.18..0.26).contains(&up) || (0.70..0.78).contains(&up);
        rail || (from_middle < 0.27 && up < tip)
    };
    let alpha: Vec<u8> =
        (0..height).flat_map(|y| (0..width).map(move |x| 255 * u8::from(solid(x, y)))).collect();
    AlphaMask::from_alpha(width, height, &alpha, 0.5, [Wrap::Clamp; 2]).map(Arc::new)
}
