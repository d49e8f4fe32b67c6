//! Planar shadows: casters projected onto a flat receiver (Szabó, sections 5.1 and 5.2).
//!
//! # The matrix
//! Let p = (n, d) be the receiver's plane, p·x = n·x + d the height of a point x = (x, 1) over it, and l the light: (L, 1)
//! at a place, (direction towards it, 0) at infinity. The line from l through x meets the plane at the combination of
//! both whose height is 0:
//!
//! > T x = (p·l) x − (p·x) l, that is T = (p·l) I − l pᵀ,
//!
//! since p·(T x) = 0. With γ = p·l the paper's entries are those of T, for rows instead of columns (its scan has lost
//! the signs of two of them). The image's w is γ − (p·x) at a place and γ at infinity: positive below the light, 0 at
//! its height, negative above, where T would show a caster upside down.
//!
//! # No false shadows
//! What lies under the receiver, or above the light, throws no shadow on it but has an image under T. The first is cut
//! off by the rasteriser: the depth that it clips at is the height. The second is cut off before ([`Clipped`]).

use std::ops::Range;

use glam::{Affine3A, DMat4, DVec2, DVec3, DVec4, Vec2, Vec3};
use scene_core::geometry::ObjectFlags;
use scene_core::{Camera, Scene, TriangleMesh};

use crate::crossing::HomogeneousLight;
use crate::receivers::Receiver;

/// T of the module's page, world to world.
pub fn shadow_projection(plane: DVec4, light: &HomogeneousLight) -> DMat4 {
    let l = light.point.extend(if light.at_infinity { 0.0 } else { 1.0 });
    let gamma = plane.dot(l);
    DMat4::from_cols(
        DVec4::X * gamma - l * plane.x,
        DVec4::Y * gamma - l * plane.y,
        DVec4::Z * gamma - l * plane.z,
        DVec4::W * gamma - l * plane.w,
    )
}

/// World to the clip space of `camera` for casters: x, y and w are those of a caster's image on the plane, depth is a
/// small multiple of its height over the tolerance, so that what is not above the plane lies beyond the far plane.
pub fn clip_from_caster(receiver: &Receiver, light: &HomogeneousLight, camera: &Camera) -> DMat4 {
    /// Small enough that no height over any w comes near 1, the near plane, and large enough for f32.
    const SMALL: f64 = 1e-20;
    let axes = camera.world_from_view_rotation().as_dmat3().transpose();
    let eye = camera.eye.as_dvec3();
    let view = DMat4::from_cols(
        axes.x_axis.extend(0.0),
        axes.y_axis.extend(0.0),
        axes.z_axis.extend(0.0),
        (-(axes * eye)).extend(1.0),
    );
    let tan = camera.tan_half_fov().as_dvec2();
    let projection = DMat4::from_cols(
        DVec4::new(1.0 / tan.x, 0.0, 0.0, 0.0),
        DVec4::new(0.0, 1.0 / tan.y, 0.0, 0.0),
        DVec4::new(0.0, 0.0, 0.0, -1.0),
        DVec4::ZERO,
    );
    // Of unit scale, so that γ near 0 does not push w out of f32's range.
    let image = projection * view * shadow_projection(receiver.plane, light) * (1.0 / receiver.light_height);
    let height = (receiver.plane - DVec4::W * receiver.tolerance) * SMALL;
    DMat4::from_cols_array_2d(&std::array::from_fn(|column| {
        let c = image.col(column);
        [c.x, c.y, height[column], c.w]
    }))
}

/// The casters of a receiver below a light at a place.
#[derive(Debug, Default)]
pub struct Clipped {
    /// Triangles that lie below the light with all corners, as ranges of [`Scene::triangles`].
    pub whole: Vec<Range<usize>>,
    /// What lies below the light of those that reach above.
    pub cut: Scene,
}

impl Clipped {
    /// All casters. Of the receiver's own object that is what rises above the plane: the receiver is flat and shadows no part
    /// of itself.
    pub fn new(scene: &Scene, receiver: &Receiver, light: &HomogeneousLight) -> Self {
        let mut clipped = Self::default();
        // A caster at the light's height has its image at infinity; what is left out is 2⁻²⁰ of the way up.
        let ceiling = receiver.light_height * (1.0 - 1.0 / 1_048_576.0);
        let height = |p: DVec3| receiver.plane.dot(p.extend(1.0));
        for object in scene.objects().iter().filter(|o| o.flags.casts) {
            let corners = object.bounds.corners().map(|c| height(c.as_dvec3()));
            let highest = corners.into_iter().fold(f64::NEG_INFINITY, f64::max);
            if corners.into_iter().all(|h| h <= receiver.tolerance) {
                continue;
            }
            if light.at_infinity || highest < ceiling {
                clipped.keep(object.triangles.clone());
                continue;
            }
            let mut mesh = TriangleMesh::new("cut", Vec::new(), Vec::new());
            mesh.alpha.clone_from(&object.alpha);
            for triangle in object.triangles.clone() {
                let uv =
                    |vertex: u32| scene.uvs().get(vertex as usize).copied().unwrap_or(Vec2::NAN).as_dvec2();
                let uvs = scene.triangles()[triangle].map(uv);
                let corners = scene.corners(triangle).map(Vec3::as_dvec3);
                let below = corners.map(|c| height(c) < ceiling);
                if below == [true; 3] {
                    clipped.keep(triangle..triangle + 1);
                } else if below != [false; 3] {
                    cut_below(&mut mesh, corners, uvs, |p| ceiling - height(p));
                }
            }
            if !mesh.triangles.is_empty() {
                // Cut points lie between corners of the scene: they are finite, and the mesh is sound.
                let _ = clipped.cut.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default());
            }
        }
        clipped
    }

    fn keep(&mut self, range: Range<usize>) {
        match self.whole.last_mut() {
            Some(last) if last.end == range.start => last.end = range.end,
            _ => self.whole.push(range),
        }
    }
}

/// Adds the part of a triangle where `inside` is not negative, with its texture coordinates.
fn cut_below(mesh: &mut TriangleMesh, corners: [DVec3; 3], uvs: [DVec2; 3], inside: impl Fn(DVec3) -> f64) {
    let first = mesh.positions.len() as u32;
    for i in 0..3 {
        let j = (i + 1) % 3;
        let (da, db) = (inside(corners[i]), inside(corners[j]));
        let mut push = |t: f64| {
            mesh.positions.push((corners[i] + (corners[j] - corners[i]) * t).as_vec3());
            mesh.uvs.push((uvs[i] + (uvs[j] - uvs[i]) * t).as_vec2());
        };
        if da >= 0.0 {
            push(0.0);
        }
        if (da >= 0.0) != (db >= 0.0) {
            push(da / (da - db));
        }
    }
    let count = mesh.positions.len() as u32 - first;
    mesh.triangles.extend((1..count.saturating_sub(1)).map(|i| [first, first + i, first + i + 1]));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_lie_on_the_plane_and_on_the_ray_from_the_light() {
        let plane = DVec3::new(0.6, 0.8, 0.0).extend(-0.3);
        let x = DVec3::new(0.4, 1.5, -0.7);
        for light in [
            HomogeneousLight { point: DVec3::new(1.0, 4.0, 0.5), at_infinity: false },
            HomogeneousLight { point: DVec3::new(0.1, 0.9, 0.2), at_infinity: true },
        ] {
            let image = shadow_projection(plane, &light) * x.extend(1.0);
            assert!(image.w > 0.0 && plane.dot(image).abs() < 1e-12);
            let on_plane = image.truncate() / image.w;
            assert!((on_plane - x).normalize().cross(light.from_point(x).normalize()).length() < 1e-12);
        }
        let light = HomogeneousLight { point: DVec3::new(1.0, 4.0, 0.5), at_infinity: false };
        let above = shadow_projection(plane, &light) * DVec3::new(1.0, 9.0, 0.5).extend(1.0);
        assert!(above.w < 0.0, "above the light the image is upside down");
    }
}
