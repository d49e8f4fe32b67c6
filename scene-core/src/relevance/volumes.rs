//! The volumes that a light's maps share the receivers by, for [`Receivers::inside`](super::Receivers::inside): cascades
//! and the faces of a cube.
//!
//! A map of a part needs the casters between that part and the light only:
//!
//! ```
//! use gnomon_scene_core::relevance::{
//!     CasterChunks, CasterRegion, Receivers, depth_slice, objects_among, relevant_casters,
//! };
//! use gnomon_scene_core::scenes;
//!
//! let setup = scenes::build("street", 0.0)?;
//! let (scene, camera, light) = (&setup.scene, &setup.camera, &setup.lights[0]);
//! let chunks = CasterChunks::new(scene);
//! let mut kept = Vec::new();
//! for [near, far] in [[0.3, 20.0], [20.0, 80.0], [80.0, f32::INFINITY]] {
//!     let receivers = Receivers::seen_by(scene, camera, light).inside(&depth_slice(camera, near, far));
//!     // Nobody looks at a cascade without receivers: it needs no map.
//!     if !receivers.is_empty() {
//!         let region = CasterRegion::between(scene, &receivers, light);
//!         kept.push(relevant_casters(scene, &region, &chunks, |_| true).triangles_kept);
//!         assert!(objects_among(scene, &receivers).len() < scene.objects().len());
//!     }
//! }
//! assert!(kept[0] < scene.caster_count() / 2);
//! # Ok::<(), gnomon_scene_core::scenes::SceneSpecError>(())
//! ```
//!
//! With maps, whose texels are looked up beside the receivers too, take
//! [`CasterRegion::along`](super::CasterRegion::along) of receivers that are [`grown`](super::Receivers::grown) by a
//! texel's diagonal.

use glam::{DVec3, Mat3, Vec2, Vec3};

use super::HalfSpace;
use crate::Camera;

/// What lies between the distances `near` and `far` along a camera's view direction, in scene units: a cascade. A
/// distance that is not finite is no border.
pub fn depth_slice(camera: &Camera, near: f32, far: f32) -> Vec<HalfSpace> {
    let axes = camera.world_from_view_rotation().as_dmat3();
    let eye = camera.eye.as_dvec3();
    let forward = axes.x_axis.cross(axes.y_axis).normalize_or_zero() * -1.0;
    let depth_of = |t: f32| forward.dot(eye + axes * DVec3::new(0.0, 0.0, -f64::from(t)));
    let planes = [
        HalfSpace { normal: -forward, offset: -depth_of(near) },
        HalfSpace { normal: forward, offset: depth_of(far) },
    ];
    sound(planes)
}

/// What is seen from `apex` through the rectangle of tangents `min … max` in the axes of `axes` (columns right, up and
/// backwards): a map's view, without near and far. A face of a cube has tangents from −1 to 1.
///
/// Half-spaces without a normal, of a rectangle without extent or numbers that are not finite, are left out.
pub fn pyramid(apex: Vec3, axes: Mat3, min: Vec2, max: Vec2) -> Vec<HalfSpace> {
    let (axes, apex) = (axes.as_dmat3(), apex.as_dvec3());
    let ray = |x: f32, y: f32| axes * DVec3::new(f64::from(x), f64::from(y), -1.0);
    let corners = [ray(min.x, min.y), ray(max.x, min.y), ray(max.x, max.y), ray(min.x, max.y)];
    // Counter-clockwise as seen from the apex: a corner's ray × the next one's points out.
    sound((0..4).map(|i| {
        let normal = corners[i].cross(corners[(i + 1) % 4]).normalize_or_zero();
        HalfSpace { normal, offset: normal.dot(apex) }
    }))
}

fn sound(planes: impl IntoIterator<Item = HalfSpace>) -> Vec<HalfSpace> {
    let is_sound = |p: &HalfSpace| p.normal.is_finite() && p.normal != DVec3::ZERO && p.offset.is_finite();
    planes.into_iter().filter(is_sound).collect()
}
