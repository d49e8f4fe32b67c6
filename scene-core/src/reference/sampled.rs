//! Ground truth by stratified shadow rays.

use std::ops::ControlFlow;

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::Occlusion;
use super::proof::{Memory, Proof, Prover};
use super::tiles::{Cancelled, Estimate, Reference, Work, estimate_tiles};
use crate::bvh::shadow_origin;
use crate::light::LightPoint;
use crate::light::sampling::{LightView, SampleKey, Strata};
use crate::{GBuffer, Light, Scene};

/// How ground truth is sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ReferenceSettings {
    /// Shadow rays a pixel, rounded up to an even number (0 counts as 2); they come in independent pairs, one pair
    /// a stratum. A light without extent takes one ray whatever this says.
    pub samples: u32,
    /// The same seed gives the same image, bit for bit, on any number of threads.
    pub seed: u64,
    /// Leave out the rays of pixels that are proved wholly lit or wholly dark. V is the same, bit for bit; their
    /// standard error is then 0.
    pub skip: bool,
}

impl Default for ReferenceSettings {
    fn default() -> Self {
        Self { samples: 256, seed: 0, skip: true }
    }
}

/// V of `light` for every pixel of `gbuffer` that sees a surface, blocked by `casters`.
///
/// A sample of the light on or below the tangent plane of the surface (its normal turned to the camera) is
/// not seen. Points outside a spot's cone have V = 0; objects that do not receive shadows have V = 1.
///
/// `progress` is called with the fraction done in [0, 1] after every tile, from any thread and not always in
/// order; if it breaks, the work ends soon after.
///
/// # Errors
/// [`Cancelled`] if `progress` breaks.
pub fn reference(
    scene: &Scene,
    casters: &impl Occlusion,
    light: &Light,
    gbuffer: &GBuffer,
    settings: &ReferenceSettings,
    progress: &(dyn Fn(f32) -> ControlFlow<()> + Sync),
) -> Result<Reference, Cancelled> {
    let tracer = Tracer { casters, light, gbuffer, settings, magnitude: scene.bounds().magnitude() };
    where_not_proved(scene, tracer, progress, |pixel, scratch, work| tracer.pixel(pixel, scratch, work))
}

/// V of every pixel that sees a surface: what is proved, and what `sample` says where nothing is.
pub(super) fn where_not_proved<O: Occlusion>(
    scene: &Scene,
    tracer: Tracer<'_, O>,
    progress: &(dyn Fn(f32) -> ControlFlow<()> + Sync),
    sample: impl Fn(usize, &mut Scratch, &mut Work) -> Estimate + Sync,
) -> Result<Reference, Cancelled> {
    let Tracer { casters, light, gbuffer, settings, magnitude } = tracer;
    let tree = casters.tree().filter(|_| settings.skip);
    let prover = tree.map(|tree| Prover::new(tree, light, gbuffer, magnitude));
    let begin = |x, y, scratch: &mut Scratch| {
        if let Some(prover) = &prover {
            prover.begin_tile(x, y, &mut scratch.proofs);
        }
    };
    estimate_tiles(scene, light, gbuffer, progress, Scratch::default, begin, |pixel, scratch, work| {
        match prover.as_ref().and_then(|prover| prover.prove(pixel, &mut scratch.proofs)) {
            Some(Proof::Lit) => {
                work.proved_lit += 1;
                Estimate::certain(1.0)
            }
            Some(Proof::Dark) => {
                work.proved_dark += 1;
                Estimate::certain(0.0)
            }
            None => {
                work.sampled += 1;
                sample(pixel, scratch, work)
            }
        }
    })
}

/// A thread's buffers, kept from pixel to pixel.
#[derive(Default)]
pub(super) struct Scratch {
    /// Samples of the light; those above the tangent plane are moved to the front.
    points: Vec<LightPoint>,
    /// Which sample each of those was.
    sample_of: Vec<u32>,
    /// What the ray tracer says of them.
    blocked: Vec<bool>,
    /// Per sample whether it is seen.
    seen: Vec<bool>,
    proofs: Memory,
}

/// Traces the samples of a pixel.
pub(super) struct Tracer<'a, O> {
    pub(super) casters: &'a O,
    pub(super) light: &'a Light,
    pub(super) gbuffer: &'a GBuffer,
    pub(super) settings: &'a ReferenceSettings,
    /// Largest coordinate of the scene.
    pub(super) magnitude: f32,
}

impl<O> Copy for Tracer<'_, O> {}

impl<O> Clone for Tracer<'_, O> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<O: Occlusion> Tracer<'_, O> {
    /// V of a pixel by its samples.
    pub(super) fn pixel(&self, pixel: usize, scratch: &mut Scratch, work: &mut Work) -> Estimate {
        let (position, normal) = (self.gbuffer.position[pixel], self.gbuffer.normal[pixel]);
        let view = LightView::new(self.light, position);
        let strata = if view.is_single() {
            Strata::new(1, 1.0)
        } else {
            Strata::paired(self.settings.samples, view.aspect())
        };
        let samples = strata.sample_count();
        scratch.points.resize(samples, LightPoint::Towards(Vec3::Y));
        strata.fill(&view, SampleKey::new(self.settings.seed, pixel as u64), &mut scratch.points);
        work.rays += self.trace(position, normal, scratch);

        let seen = scratch.seen.iter().filter(|&&s| s).count();
        let n = samples as f32;
        let visibility = seen as f32 / n;
        if view.is_single() {
            return Estimate::certain(visibility);
        }
        // A stratum's mean (a + b)/2 has the variance (a − b)²/4, so the mean over n/2 strata has the number
        // of strata that disagree over n².
        let split = scratch.seen.chunks_exact(2).filter(|pair| pair[0] != pair[1]).count();
        Estimate { visibility, std_error: (split.max(1) as f32).sqrt() / n }
    }

    /// Sets `scratch.seen` for all of `scratch.points`; returns how many rays it took.
    fn trace(&self, position: Vec3, normal: Vec3, scratch: &mut Scratch) -> u64 {
        let Scratch { points, sample_of, blocked, seen, .. } = scratch;
        seen.clear();
        seen.resize(points.len(), false);
        sample_of.clear();
        for sample in 0..points.len() {
            let height = match points[sample] {
                LightPoint::At(point) => normal.dot(point - position),
                LightPoint::Towards(direction) => normal.dot(direction),
            };
            if height > 0.0 {
                points[sample_of.len()] = points[sample];
                sample_of.push(sample as u32);
            }
        }
        let above = sample_of.len();
        blocked.clear();
        blocked.resize(above, false);
        let origin = shadow_origin(position, normal, self.magnitude);
        self.casters.occluded_from(origin, &points[..above], blocked);
        for (&sample, &blocked) in sample_of.iter().zip(&*blocked) {
            seen[sample as usize] = !blocked;
        }
        above as u64
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use glam::Affine3A;

    use super::*;
    use crate::TriangleMesh;
    use crate::geometry::ObjectFlags;
    use crate::reference::no_progress;

    /// The half-space x < 0 at height 1: blocks what crosses the plane y = 1 left of the edge x = 0.
    struct HalfPlane;

    impl Occlusion for HalfPlane {
        fn occluded_from(&self, origin: Vec3, targets: &[LightPoint], blocked: &mut [bool]) {
            for (target, blocked) in targets.iter().zip(blocked) {
                let (direction, end) = target.ray_from(origin);
                let t = (1.0 - origin.y) / direction.y;
                *blocked = t > 0.0 && t < end && origin.x + t * direction.x < 0.0;
            }
        }
    }

    const LIGHT: Light =
        Light::Rect { center: Vec3::new(0.0, 2.0, 0.0), half_u: Vec3::X, half_v: Vec3::new(0.0, 0.0, 1.0) };

    /// A floor seen from above, x from −2 to 2 over the columns; object 1 sits in the last row.
    fn floor(width: u32, height: u32) -> (Scene, GBuffer) {
        let mut scene = Scene::new();
        let mesh = TriangleMesh::default();
        scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).unwrap();
        let flags = ObjectFlags { receives: false, ..Default::default() };
        scene.add(&mesh, Affine3A::IDENTITY, flags).unwrap();
        let mut gbuffer = GBuffer::new(width, height);
        for pixel in 0..gbuffer.pixel_count() {
            let (x, y) = (pixel as u32 % width, pixel as u32 / width);
            gbuffer.position[pixel] = Vec3::new((x as f32 + 0.5) / width as f32 * 4.0 - 2.0, 0.0, 0.0);
            gbuffer.normal[pixel] = Vec3::Y;
            gbuffer.triangle[pixel] = 0;
            gbuffer.object[pixel] = u32::from(y + 1 == height);
        }
        (scene, gbuffer)
    }

    fn run(light: &Light, gbuffer: &GBuffer, scene: &Scene, settings: ReferenceSettings) -> Reference {
        reference(scene, &HalfPlane, light, gbuffer, &settings, &no_progress).unwrap()
    }

    #[test]
    fn every_surface_pixel_gets_a_value_and_no_other() {
        let (scene, mut gbuffer) = floor(37, 21);
        gbuffer.triangle[5] = GBuffer::NOTHING;
        let truth =
            run(&LIGHT, &gbuffer, &scene, ReferenceSettings { samples: 16, seed: 1, ..Default::default() });
        for pixel in 0..gbuffer.pixel_count() {
            assert_eq!(truth.visibility.values[pixel].is_nan(), pixel == 5);
            assert_eq!(truth.std_error[pixel].is_nan(), pixel == 5);
        }
        assert_eq!(truth.work.rays, (20 * 37 - 1) * 16);
        // The last row does not receive; elsewhere the outer columns are dark and lit.
        assert!(truth.visibility.values[20 * 37..].iter().all(|&v| v == 1.0));
        assert_eq!((truth.visibility.at(0, 3), truth.visibility.at(36, 3)), (0.0, 1.0));
    }

    #[test]
    fn the_image_depends_on_the_seed_alone() {
        let (scene, gbuffer) = floor(50, 40);
        let settings = ReferenceSettings { samples: 30, seed: 7, ..Default::default() };
        let images: Vec<_> = [1, 2, 5]
            .map(|threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| run(&LIGHT, &gbuffer, &scene, settings))
            })
            .into();
        assert_eq!(images[0], images[1]);
        assert_eq!(images[0], images[2]);
        let other = run(&LIGHT, &gbuffer, &scene, ReferenceSettings { seed: 8, ..settings });
        assert_ne!(images[0].visibility, other.visibility);
    }

    #[test]
    fn points_and_spots_take_one_ray_or_none() {
        let (scene, gbuffer) = floor(64, 2);
        let position = Vec3::new(0.0, 2.0, 0.0);
        let settings = ReferenceSettings::default();
        let point = run(&Light::Point { position }, &gbuffer, &scene, settings);
        assert_eq!(point.work.rays, 64);
        assert_eq!((point.visibility.at(31, 0), point.visibility.at(32, 0)), (0.0, 1.0));
        assert!(point.std_error.iter().all(|&e| e == 0.0));
        // The cone ends at |x| = 1, that is at columns 16 and 48.
        let spot = Light::Spot { position, direction: Vec3::NEG_Y, outer: 0.5f32.atan(), inner: 0.0 };
        let spot = run(&spot, &gbuffer, &scene, settings);
        assert_eq!(spot.work.rays, 32);
        assert_eq!((spot.visibility.at(47, 0), spot.visibility.at(48, 0)), (1.0, 0.0));
    }

    #[test]
    fn light_below_the_tangent_plane_is_unseen_and_costs_nothing() {
        let (scene, gbuffer) = floor(1, 1);
        let mut gbuffer = GBuffer { object: vec![0], ..gbuffer };
        gbuffer.position[0].x = 50.0;
        // Half of the sphere's cap is above a floor through its centre: in solid angle too, by symmetry.
        let ball = Light::Sphere { center: Vec3::new(40.0, 0.0, 0.0), radius: 1.0 };
        let truth =
            run(&ball, &gbuffer, &scene, ReferenceSettings { samples: 4096, seed: 0, ..Default::default() });
        let (v, error) = (truth.visibility.at(0, 0), truth.std_error[0]);
        assert!((v - 0.5).abs() < 4.0 * error && error > 0.0, "{v} ± {error}");
        assert_eq!(truth.work.rays, (v * 4096.0) as u64);
        let below = Light::Sphere { center: Vec3::new(40.0, -1.0, 0.0), radius: 1.0 };
        let truth = run(&below, &gbuffer, &scene, ReferenceSettings::default());
        assert_eq!((truth.visibility.at(0, 0), truth.work.rays), (0.0, 0));
    }

    #[test]
    fn progress_ends_at_one_and_can_cancel() {
        let (scene, gbuffer) = floor(64, 48);
        let settings = ReferenceSettings { samples: 2, seed: 0, ..Default::default() };
        let (calls, last) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let count = |fraction: f32| {
            calls.fetch_add(1, Ordering::Relaxed);
            last.fetch_max((fraction * 100.0) as usize, Ordering::Relaxed);
            ControlFlow::Continue(())
        };
        reference(&scene, &HalfPlane, &LIGHT, &gbuffer, &settings, &count).unwrap();
        assert_eq!((calls.into_inner(), last.into_inner()), (12, 100));
        let stop = |fraction: f32| {
            if fraction > 0.3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        assert_eq!(reference(&scene, &HalfPlane, &LIGHT, &gbuffer, &settings, &stop), Err(Cancelled));
    }

    #[test]
    fn an_empty_image_is_fine() {
        let truth = run(&LIGHT, &GBuffer::new(0, 0), &Scene::new(), ReferenceSettings::default());
        assert_eq!((truth.work.rays, truth.visibility.values.len()), (0, 0));
        let (scene, gbuffer) = floor(3, 3);
        let few =
            run(&LIGHT, &gbuffer, &scene, ReferenceSettings { samples: 0, seed: 0, ..Default::default() });
        assert_eq!(few.work.rays, 12);
    }
}
