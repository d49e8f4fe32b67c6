//! The layout of a PDSM: one window that all rays and all shadow maps look through (section 3.1, the planar parallel
//! configuration).
//!
//! Let the samples of the light lie in a plane, C be its middle, z the distance from it and F that of a plane parallel
//! to it, the window's. A point at distance z whose ray from C passes the window at q is projected from the sample
//! C + a onto the window at q + a·t with **t = 1 − F/z**. In a parallel light whose samples travel along n + a, where a
//! is perpendicular to the middle direction n, it is q − a·(z − F): **t = (z − F)/r** for any unit r. In both, depth
//! is t in every map and in the PDSM, planes stay planes, and a ray is q + D·t in the map of the sample with step D.
//!
//! A window spans what of the casters can shadow receivers, and is turned about the way of its light so that its area is
//! least. Parts of what a camera sees have windows of their own ([`parts`]).
//!
//! So rect and disk lights and the sun are exact. A sphere is taken for the disk that the middle of the casters sees
//! as large; from inside the casters' bounds six windows stand around it as the faces of a cube.

mod cone;
mod fit;
mod placement;
mod view;

use glam::{DVec3, Mat4, Vec2, Vec3, Vec4};
use scene_core::geometry::Aabb;

pub use fit::Fit;
pub(crate) use placement::Placement;
pub use view::{Part, parts};

/// How distance becomes t.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Depth {
    /// t = 1 − focus/z, from a middle at the origin.
    Central { focus: f32 },
    /// `t = (z − focus)·per_unit`.
    Parallel { focus: f32, per_unit: f32 },
}

/// One window: from world space to texels and t, for the light's middle and for each sample.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    /// Where it has its points.
    pub(crate) placement: Placement,
    /// Texels a side.
    pub(crate) map_size: u32,
    /// z of the nearest and of the farthest caster that the maps draw.
    pub(crate) caster_range: [f64; 2],
    /// Samples of the light: offsets a in the window's plane.
    pub(crate) offsets: Vec<Vec2>,
}

/// What a window holds that is fitted to a part of a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Held {
    /// Where points lie, world space.
    pub(crate) bounds: Aabb,
    /// Where their rays lie on the window, in texels: from, to.
    pub(crate) texels: [Vec2; 2],
}

/// A point as a layout has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WindowPoint {
    /// Position on the window, in texels.
    pub texel: Vec2,
    /// Depth along the ray.
    pub t: f32,
}

impl Layout {
    /// Samples of the light, each as the step D in texels per unit of t.
    pub fn steps(&self) -> impl ExactSizeIterator<Item = Vec2> + '_ {
        let scale = match self.placement.depth {
            Depth::Central { .. } => self.placement.texels_per_unit,
            Depth::Parallel { per_unit, .. } => -self.placement.texels_per_unit / per_unit,
        };
        self.offsets.iter().map(move |&offset| offset * scale)
    }

    /// t from before the nearest caster to beyond the farthest point that rays are asked for.
    pub fn t_range(&self) -> [f32; 2] {
        let near = self.caster_range[0];
        match self.placement.depth {
            Depth::Central { focus } => [(1.0 - f64::from(focus) / near) as f32 - 1.0, 1.0],
            // Casters and receivers lie within [−1, 1].
            Depth::Parallel { .. } => [-1.01, 1.01],
        }
    }

    /// Where `point` lies; `None` if this window is not the one that looks at it.
    #[inline]
    pub fn locate(&self, point: Vec3) -> Option<WindowPoint> {
        let (at, belongs) = self.placement.place(point);
        belongs.then_some(at)
    }

    /// Whether it is fitted to a part of a scene.
    pub fn is_of_part(&self) -> bool {
        self.placement.part.is_some()
    }

    /// How large a texel is where the ray through it passes `point`, as an area across the window's axis.
    pub fn texel_area(&self, point: Vec3) -> f32 {
        let on_window = (self.placement.texels_per_unit.x * self.placement.texels_per_unit.y).recip();
        match self.placement.depth {
            Depth::Central { focus } => on_window * (self.placement.local(point).z / focus).powi(2),
            Depth::Parallel { .. } => on_window,
        }
    }

    /// Where `point` lies, also if another window looks at it; `None` on and behind the light's plane.
    #[inline]
    pub fn project(&self, point: Vec3) -> Option<WindowPoint> {
        let placement = self.placement;
        let (at, before) = placement.place_local(placement.local(point));
        before.then_some(at)
    }

    /// How t changes along the plane through `point` with unit normal `normal`: per texel of the window, and per unit
    /// that the plane is moved along its normal. Infinite where the plane holds the light's middle.
    #[inline(always)]
    pub fn plane_slope(&self, point: Vec3, normal: Vec3, t: f32) -> (Vec2, f32) {
        self.placement.plane_slope(point, normal, t)
    }

    /// The share of the samples that lie above the plane through `point` with unit normal `normal`.
    #[inline]
    pub fn share_above(&self, point: Vec3, normal: Vec3) -> f32 {
        // Mostly the plane does not cut the light.
        let placement = self.placement;
        match placement.sides(point, normal) {
            [true, _] => return 1.0,
            [_, true] => return 0.0,
            _ => {}
        }
        let (n, sign, middle) = placement.height_of_light(point, normal);
        let above = self.offsets.iter().filter(|&&a| middle + sign * n.truncate().dot(a) > 0.0).count();
        above as f32 / self.offsets.len().max(1) as f32
    }

    /// The projection of the map of the sample with step `step`: a texel's x and y in clip space, and reversed depth.
    pub fn map_projection(&self, step: Vec2) -> Mat4 {
        let [x, y, z] = self.placement.axes.map(Vec3::as_dvec3);
        let origin = self.placement.origin.as_dvec3();
        let (scale, corner) = (self.placement.texels_per_unit.as_dvec2(), self.placement.corner.as_dvec2());
        let step = step.as_dvec2();
        let m = f64::from(self.map_size);
        // Rows as functions of world space: a direction and a constant.
        let row =
            |direction: DVec3, constant: f64| (direction.extend(constant - direction.dot(origin))).as_vec4();
        let rows: [Vec4; 4] = match self.placement.depth {
            Depth::Central { focus } => {
                let f = f64::from(focus);
                // Texel·z = (F·x − corner·z)·scale + D·(z − F).
                let texel = |axis: DVec3, scale: f64, corner: f64, d: f64| {
                    (axis * (f * scale) + z * (d - corner * scale), -d * f)
                };
                let (tx, cx) = texel(x, scale.x, corner.x, step.x);
                let (ty, cy) = texel(y, scale.y, corner.y, step.y);
                let near = DVec3::ZERO;
                [
                    row(tx * (2.0 / m) - z, cx * (2.0 / m)),
                    row(z - ty * (2.0 / m), -cy * (2.0 / m)),
                    near.extend(self.caster_range[0]).as_vec4(),
                    row(z, 0.0),
                ]
            }
            Depth::Parallel { focus, per_unit } => {
                let (f, r) = (f64::from(focus), f64::from(per_unit));
                let texel = |axis: DVec3, scale: f64, corner: f64, d: f64| {
                    (axis * scale + z * (d * r), -corner * scale - d * r * f)
                };
                let (tx, cx) = texel(x, scale.x, corner.x, step.x);
                let (ty, cy) = texel(y, scale.y, corner.y, step.y);
                let [near, far] = self.caster_range;
                let per_range = 1.0 / (far - near);
                [
                    row(tx * (2.0 / m), cx * (2.0 / m) - 1.0),
                    row(-ty * (2.0 / m), 1.0 - cy * (2.0 / m)),
                    row(-z * per_range, far * per_range),
                    Vec4::W,
                ]
            }
        };
        Mat4::from_cols_array_2d(&rows.map(|row| row.to_array())).transpose()
    }

    /// t of a depth that [`map_projection`](Self::map_projection) yields; infinite for 0, where nothing is.
    pub fn t_of_depth(&self) -> impl Fn(f32) -> f32 + use<> {
        let [near, far] = self.caster_range;
        let (at_far, per_depth) = match self.placement.depth {
            Depth::Central { focus } => (1.0, (f64::from(focus) / near) as f32),
            Depth::Parallel { focus, per_unit } => {
                let r = f64::from(per_unit);
                (((far - f64::from(focus)) * r) as f32, ((far - near) * r) as f32)
            }
        };
        move |depth| if depth > 0.0 { at_far - depth * per_depth } else { f32::INFINITY }
    }

    /// Texels a side of the maps.
    pub fn map_size(&self) -> u32 {
        self.map_size
    }
}

#[cfg(test)]
mod tests {
    use scene_core::{Light, Scene, scenes};

    use super::*;

    fn lights() -> [Light; 5] {
        let center = Vec3::new(0.5, 4.0, 0.25);
        [
            Light::Rect { center, half_u: Vec3::X * 0.5, half_v: Vec3::new(0.0, 0.1, 0.4) },
            Light::Disk { center, normal: Vec3::new(0.1, -1.0, 0.2), radius: 0.5 },
            Light::Sphere { center, radius: 0.4 },
            Light::Directional { direction: Vec3::new(0.3, -1.0, 0.2), angular_radius: 0.05 },
            Light::Point { position: center },
        ]
    }

    fn fit<'a>(scene: &'a Scene, light: &'a Light, views: u32, map_size: u32, seed: u64) -> Fit<'a> {
        Fit { scene, light, views, map_size, seed }
    }

    /// What makes everything else work: in every map a point lies at q + D·t with the same t.
    #[test]
    fn rays_are_translates_in_every_map() {
        let setup = scenes::build("quads", 0.0).unwrap();
        let casters: Vec<_> = setup.scene.objects().iter().collect();
        for light in lights() {
            let (layouts, _) = fit(&setup.scene, &light, 9, 256, 1).layouts(&casters);
            assert!(!layouts.is_empty(), "{light:?}");
            for layout in &layouts {
                let t_of_depth = layout.t_of_depth();
                for step in layout.steps() {
                    let projection = layout.map_projection(step);
                    for &point in setup.scene.positions().iter().step_by(3) {
                        let Some(at) = layout.locate(point) else { continue };
                        let clip = projection * point.extend(1.0);
                        let (ndc, depth) = (clip.truncate() / clip.w, clip.z / clip.w);
                        let texel = Vec2::new(ndc.x + 1.0, 1.0 - ndc.y) * 128.0;
                        let expected = at.texel + step * at.t;
                        assert!(texel.distance(expected) < 1e-2, "{light:?}: {texel} for {expected}");
                        assert!((t_of_depth(depth) - at.t).abs() < 1e-5, "{light:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_plane_is_linear_in_the_window() {
        let setup = scenes::build("quads", 0.0).unwrap();
        let casters: Vec<_> = setup.scene.objects().iter().collect();
        let normal = Vec3::new(0.3, 0.9, -0.2).normalize();
        let point = Vec3::new(0.1, 0.4, 0.2);
        let (u, v) = normal.any_orthonormal_pair();
        for light in lights() {
            let (layouts, _) = fit(&setup.scene, &light, 4, 256, 1).layouts(&casters);
            for layout in &layouts {
                let Some(here) = layout.locate(point) else { continue };
                let (slope, lift) = layout.plane_slope(point, normal, here.t);
                for along in [u * 0.3, v * 0.2, (u - v) * 0.1] {
                    let Some(there) = layout.locate(point + along) else { continue };
                    let predicted = here.t + slope.dot(there.texel - here.texel);
                    assert!((predicted - there.t).abs() < 1e-4, "{light:?}");
                }
                // Moving the plane by δ moves it along the ray by lift·δ.
                let moved = layout.locate(point + normal * 1e-2).unwrap();
                let change = moved.t - slope.dot(moved.texel - here.texel) - here.t;
                assert!((change.abs() / 1e-2 - lift).abs() < 0.05 * lift, "{light:?}: {change} {lift}");
            }
        }
    }

    #[test]
    fn a_light_in_the_open_has_one_window_and_one_inside_six() {
        let setup = scenes::build("ball", 0.0).unwrap();
        let casters: Vec<_> = setup.scene.objects().iter().collect();
        let count = |position| {
            let light = Light::Sphere { center: position, radius: 0.1 };
            let (layouts, skipped) = fit(&setup.scene, &light, 4, 64, 0).layouts(&casters);
            layouts.len() as u64 + skipped
        };
        let bounds = setup.scene.bounds();
        assert_eq!(count(bounds.center() + Vec3::Y * bounds.diagonal() * 3.0), 1);
        assert_eq!(count(bounds.center()), 6);
    }

    #[test]
    fn no_caster_is_no_window() {
        let scene = Scene::new();
        assert_eq!(fit(&scene, &lights()[0], 4, 64, 0).layouts(&[]), (Vec::new(), 0));
    }
}
