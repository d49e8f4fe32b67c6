//! What lives as long as the scene does, and which casters matter for a view.

use std::ops::Range;
use std::sync::Arc;

use glam::{DVec3, Vec2, Vec3};
use scene_core::bvh::Bvh;
use scene_core::geometry::{Aabb, EdgeTopology, Object, facing_of};
use scene_core::light::LightPoint;
use scene_core::relevance::{CasterChunks, CasterRegion, Receivers, relevant_casters};
use scene_core::{Camera, Light, Report, Scene};

use crate::crossing::HomogeneousLight;
use crate::error::VolumeError;
use crate::masked::MaskedCasters;
use crate::silhouette::EdgeRuns;
use crate::skips::Skips;

/// Edges and bounds of a scene's casters. Independent of light and camera.
#[derive(Clone, Debug)]
pub struct Casters<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Edges of everything that casts and has no mask, welded across objects.
    pub topology: EdgeTopology,
    /// Their faces, run by run.
    pub runs: EdgeRuns,
    /// Where the casters with masks are.
    pub masked: MaskedCasters,
    /// Bounds of runs of triangles.
    pub chunks: CasterChunks,
    /// Their tree, for pixels that are not counted.
    pub tree: Arc<Bvh>,
}

impl<'a> Casters<'a> {
    /// The casters of `scene`.
    ///
    /// # Errors
    /// More triangles than can be numbered.
    pub fn new(scene: &'a Scene) -> Result<Self, VolumeError> {
        let (topology, tree) = rayon::join(
            || EdgeTopology::of_scene(scene, |object| object.flags.casts && object.alpha.is_none()),
            || Arc::new(Bvh::casters(scene)),
        );
        let topology = topology?;
        let runs = EdgeRuns::new(&topology);
        let masked = MaskedCasters::new(scene);
        Ok(Self { scene, topology, runs, masked, chunks: CasterChunks::new(scene), tree })
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.topology.bytes() + self.runs.bytes() + self.chunks.bytes() + self.tree.bytes()
    }

    /// The casting triangles that may shadow what `camera` sees, as far as `skips` looks for them; books what is left out.
    pub fn relevant(
        &self,
        light: &Light,
        camera: &Camera,
        skips: &Skips,
        report: &mut Report,
    ) -> Vec<Range<usize>> {
        let hidden = if skips.shadowed { in_anothers_shadow(self.scene, light) } else { Vec::new() };
        report.skip("casters in another's shadow", hidden.len() as u64);
        if !skips.outside {
            let objects = (0..).zip(self.scene.objects());
            let kept = objects.filter(|(id, o)| {
                o.flags.casts && !o.triangles.is_empty() && hidden.binary_search(id).is_err()
            });
            return kept.map(|(_, o)| o.triangles.clone()).collect();
        }
        // Only the middle of the light throws shadows.
        let region = CasterRegion::of(self.scene, camera, &light.reduced_to(light.center()));
        let kept =
            relevant_casters(self.scene, &region, &self.chunks, |id| hidden.binary_search(&id).is_err());
        kept.book(report);
        kept.ranges
    }
}

/// Ids of casters that lie wholly in the shadow of one triangle: whatever they hide, it hides too.
///
/// Asked of the [`COVERS`] triangles that look largest from the light, and of the objects' boxes.
pub(crate) fn in_anothers_shadow(scene: &Scene, light: &Light) -> Vec<u32> {
    /// Large triangles tried. Each costs an object some 20 ns.
    const COVERS: usize = 16;
    /// Objects and triangles of each that are looked at for large ones: some 50 µs in all.
    const ASKED: usize = 64;
    let center = light.center();
    let homogeneous = HomogeneousLight::from(center);
    let casters = || (0_u32..).zip(scene.objects()).filter(|(_, o)| o.flags.casts && !o.bounds.is_empty());
    // Of many objects the largest are asked, and of large meshes only a few triangles: their triangles are small.
    let mut large: Vec<_> = casters().filter(|(_, object)| object.alpha.is_none()).collect();
    if large.len() > ASKED {
        let size = |object: &Object| object.bounds.diagonal();
        large.select_nth_unstable_by(ASKED, |a, b| size(b.1).total_cmp(&size(a.1)).then(a.0.cmp(&b.0)));
        large.truncate(ASKED);
    }
    let mut covers: Vec<(f64, [Vec3; 3])> = large
        .into_iter()
        .flat_map(|(_, object)| object.triangles.clone().step_by(object.triangles.len().div_ceil(ASKED)))
        .map(|triangle| {
            let corners = scene.corners(triangle);
            (apparent_size(corners, &homogeneous), corners)
        })
        .filter(|(size, _)| *size > 0.0)
        .collect();
    let count = COVERS.min(covers.len());
    if count == 0 {
        return Vec::new();
    }
    covers.select_nth_unstable_by(count - 1, |a, b| b.0.total_cmp(&a.0));
    covers.truncate(count);
    // Positions and the origins of shadow rays are exact to about 2⁻²⁰ of the largest coordinate.
    let margin = f64::from(scene.bounds().magnitude()) / 262_144.0;
    let shadows: Vec<_> = covers.iter().filter_map(|(_, c)| shadow_of(*c, center, margin)).collect();
    casters()
        .filter(|(_, object)| {
            let corners = object.bounds.corners().map(|c| c.as_dvec3());
            shadows
                .iter()
                .any(|planes| planes.iter().all(|(n, offset)| corners.iter().all(|c| n.dot(*c) <= *offset)))
        })
        .map(|(id, _)| id)
        .collect()
}

/// The solid angle up to a factor, or the area across a parallel light's direction.
fn apparent_size(corners: [Vec3; 3], light: &HomogeneousLight) -> f64 {
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    let to_light = light.from_point((a + b + c) / 3.0);
    let size = (b - a).cross(c - a).dot(to_light).abs();
    if light.at_infinity { size } else { size / to_light.length().powi(3).max(f64::MIN_POSITIVE) }
}

/// The half-spaces n·x ≤ offset whose intersection is the shadow of a triangle, made smaller by `margin`. `None` if it
/// is seen edge-on.
fn shadow_of(corners: [Vec3; 3], light: LightPoint, margin: f64) -> Option<[(DVec3, f64); 4]> {
    let turned = match facing_of(corners, light) {
        1 => corners,
        -1 => [corners[0], corners[2], corners[1]],
        _ => return None,
    };
    let [a, b, c] = turned.map(Vec3::as_dvec3);
    let light = HomogeneousLight::from(light);
    let plane = |normal: DVec3, through: DVec3| {
        let normal = normal.normalize_or_zero();
        (normal, normal.dot(through) - margin)
    };
    let side = |a: DVec3, b: DVec3| plane((b - a).cross(light.from_point(a)), a);
    let shadow = [plane((b - a).cross(c - a), a), side(a, b), side(b, c), side(c, a)];
    shadow.iter().all(|(n, _)| *n != DVec3::ZERO).then_some(shadow)
}

/// The box around a camera's eye and near rectangle.
pub(crate) fn near_box(camera: &Camera) -> Aabb {
    let (w, h) = (camera.width as f32, camera.height as f32);
    let corners = [Vec2::ZERO, Vec2::new(w, 0.0), Vec2::new(0.0, h), Vec2::new(w, h)];
    let corners = corners.map(|pixel| camera.eye + camera.ray_direction(pixel) * camera.near);
    Aabb::from_points(corners.into_iter().chain([camera.eye]))
}

/// The casting objects of which some triangle may lie in the pyramid of light, eye and near rectangle, by id. For all
/// others the eye is outside of every volume and no part of them is cut off by the near plane: counting from the eye
/// is right for them.
///
/// The pyramid is taken with the box around eye and near rectangle.
pub fn near_casters(casters: &Casters<'_>, light: &Light, camera: &Camera) -> Vec<u32> {
    let center = light.center().as_light();
    let receivers = Receivers::within(casters.scene, &[near_box(camera)], &center);
    let region = CasterRegion::between(casters.scene, &receivers, &center);
    let near = relevant_casters(casters.scene, &region, &casters.chunks, |_| true).ranges;
    let touched = |triangles: &Range<usize>| {
        let first = near.partition_point(|range| range.end <= triangles.start);
        near.get(first).is_some_and(|range| range.start < triangles.end)
    };
    let objects = (0..).zip(casters.scene.objects());
    objects.filter(|(_, o)| o.flags.casts && touched(&o.triangles)).map(|(id, _)| id).collect()
}
