//! A naive ray caster in f64 to hold the rasteriser against.

use glam::{DMat4, DVec3, DVec4, Vec3};
use gnomon_scene_core::Scene;

/// A hit: where along the ray, which triangle, and how far inside it the ray passes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hit {
    pub(crate) t: f64,
    pub(crate) triangle: usize,
}

/// Möller and Trumbore's test without culling: ray parameter and the smallest of the three barycentric weights,
/// which is negative outside.
pub(crate) fn intersect(origin: DVec3, direction: DVec3, corners: [Vec3; 3]) -> Option<(f64, f64)> {
    let [a, b, c] = corners.map(|p| p.as_dvec3());
    let (ab, ac) = (b - a, c - a);
    let p = direction.cross(ac);
    let determinant = ab.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let s = origin - a;
    let u = s.dot(p) / determinant;
    let q = s.cross(ab);
    let v = direction.dot(q) / determinant;
    Some((ac.dot(q) / determinant, u.min(v).min(1.0 - u - v)))
}

/// The nearest hit with t in `range` among the triangles that `keep` admits.
pub(crate) fn cast(
    scene: &Scene,
    origin: DVec3,
    direction: DVec3,
    range: [f64; 2],
    keep: impl Fn(usize) -> bool,
) -> Option<Hit> {
    let mut nearest: Option<Hit> = None;
    for triangle in (0..scene.triangles().len()).filter(|&t| keep(t)) {
        let Some((t, inside)) = intersect(origin, direction, scene.corners(triangle)) else { continue };
        if inside >= 0.0 && t >= range[0] && t <= range[1] && nearest.is_none_or(|n| t < n.t) {
            nearest = Some(Hit { t, triangle });
        }
    }
    nearest
}

/// Depths at a pixel's centre of all triangles over it; `None` if an edge of any passes within `margin` pixels of
/// the centre, where snapping may decide otherwise. Triangles must lie wholly before the eye.
pub(crate) fn depths_at(
    scene: &Scene,
    clip_from_world: &DMat4,
    size: [u32; 2],
    pixel: [u32; 2],
    margin: f64,
) -> Option<Vec<f64>> {
    let (x, y) = (f64::from(pixel[0]) + 0.5, f64::from(pixel[1]) + 0.5);
    let mut depths = Vec::new();
    for triangle in 0..scene.triangles().len() {
        let [a, b, c] = scene.corners(triangle).map(|p| {
            let clip = *clip_from_world * DVec4::from((p.as_dvec3(), 1.0));
            let ndc = clip / clip.w;
            let half = [f64::from(size[0]) * 0.5, f64::from(size[1]) * 0.5];
            DVec3::new((ndc.x + 1.0) * half[0] - x, (1.0 - ndc.y) * half[1] - y, ndc.z)
        });
        let cross = |p: DVec3, q: DVec3| p.x * q.y - p.y * q.x;
        let to_segment = |p: DVec3, q: DVec3| {
            let (p, d) = (p.truncate(), (q - p).truncate());
            let t = (-p.dot(d) / d.length_squared()).clamp(0.0, 1.0);
            (p + d * if t.is_nan() { 0.0 } else { t }).length()
        };
        if to_segment(a, b).min(to_segment(b, c)).min(to_segment(c, a)) < margin {
            return None;
        }
        let weights = [cross(b, c), cross(c, a), cross(a, b)];
        let area: f64 = weights.iter().sum();
        if weights.iter().all(|w| *w > 0.0) || weights.iter().all(|w| *w < 0.0) {
            depths.push((weights[0] * a.z + weights[1] * b.z + weights[2] * c.z) / area);
        }
    }
    Some(depths)
}
