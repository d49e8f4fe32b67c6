//! Against ground truth: what is left is the maps' resolution and their number.

use glam::{Affine3A, Vec2, Vec3};
use gnomon_pdsm::{Pdsm, PdsmParams};
use scene_core::bvh::Bvh;
use scene_core::geometry::ObjectFlags;
use scene_core::reference::{self, ReferenceSettings, no_progress};
use scene_core::{Light, Scene, TriangleMesh, VisibilityImage, metrics, raster, scenes};

/// rmse of the built-in scene `spec` over valid pixels, against 1,024 samples, by each of `settings`.
fn errors(spec: &str, settings: &[PdsmParams]) -> Vec<f64> {
    let mut setup = scenes::build(spec, 0.0).expect("a built-in scene");
    (setup.camera.width, setup.camera.height) = (128, 96);
    let (scene, light) = (&setup.scene, &setup.lights[0]);
    let gbuffer = raster::render_gbuffer(scene, &setup.camera);
    let sampling = ReferenceSettings { samples: 1024, ..Default::default() };
    let truth = reference::reference(scene, &Bvh::casters(scene), light, &gbuffer, &sampling, &no_progress)
        .expect("nobody cancels");
    let valid = reference::valid_pixels(&gbuffer, light);
    let rmse = |params: &PdsmParams| {
        let (pdsm, _) = Pdsm::new(*params).prepare(scene, light);
        let mut image = VisibilityImage::new(gbuffer.width, gbuffer.height);
        pdsm.shade(&gbuffer, &mut image);
        metrics::errors(&image, &truth.visibility, &valid).expect("images of one size").rmse
    };
    settings.iter().map(rmse).collect()
}

/// More maps of more texels come closer, and near enough: an rmse of 0.02.
#[test]
fn error_falls_with_views_and_resolution() {
    let setting = |views, size| PdsmParams {
        views,
        map_size: size,
        pdsm_size: size,
        max_error: 0.5 / views as f32,
        ..Default::default()
    };
    for spec in ["quads", "ball", "cylinder"] {
        let errors = errors(spec, &[setting(9, 64), setting(36, 192), setting(100, 512)]);
        assert!(errors.windows(2).all(|pair| pair[1] < pair[0]), "{spec}: {errors:?}");
        assert!(errors[2] < 0.02, "{spec}: {errors:?}");
    }
}

/// Distance in texels of `point` from the rim of a convex quadrilateral, and whether it lies inside.
fn from_rim(corners: &[Vec2; 4], point: Vec2) -> (f32, bool) {
    let mut nearest = f32::INFINITY;
    let mut sides = [false; 2];
    for i in 0..4 {
        let (a, b) = (corners[i], corners[(i + 1) % 4]);
        let along = ((point - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
        nearest = nearest.min(point.distance(a + (b - a) * along));
        sides[usize::from((b - a).perp_dot(point - a) > 0.0)] = true;
    }
    (nearest, sides != [true; 2])
}

/// With the samples of the light that the maps were drawn from, what differs is the maps' resolution and nothing else.
///
/// Exact V is counted sample by sample: a point at (q, t) lies at q + D·t in the map of the sample with step D, and is in
/// shadow inside of the caster's image there. Bilinear lookup reads rays whose centres are up to a pixel away along both
/// axes, √2; each is compared with a texel whose centre is up to half a texel away along both, √½; snapping moves the rim
/// by √2/256. So a sample's answer can differ only where the rim is nearer than 2.13 texels: at every point V is off by at
/// most the share of such samples. And on average by an amount in proportion to a texel.
#[test]
fn the_same_samples_differ_by_the_maps_resolution_alone() {
    const REACH: f32 = 1.5 * std::f32::consts::SQRT_2 + 0.008;
    let square = |y: f32, half: f32| {
        let corners = [(-half, -half), (-half, half), (half, half), (half, -half)];
        corners.map(|(x, z)| Vec3::new(x + 0.1 * y, y, z + 0.3 * x * y))
    };
    let mut scene = Scene::new();
    for corners in [square(0.0, 4.0), square(1.0, 0.6)] {
        let mesh = TriangleMesh::new("square", corners.to_vec(), vec![[0, 1, 2], [0, 2, 3]]);
        scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).expect("a sound mesh");
    }
    let light =
        Light::Rect { center: Vec3::new(0.1, 4.0, -0.2), half_u: Vec3::X * 0.5, half_v: Vec3::Z * 0.4 };
    let points: Vec<Vec3> = (0..150 * 150)
        .map(|i| Vec3::new((i % 150) as f32 / 50.0 - 1.5, 0.0, (i / 150) as f32 / 50.0 - 1.5))
        .collect();
    let mut means = Vec::new();
    for size in [64, 128, 256, 512] {
        let params =
            PdsmParams { views: 25, map_size: size, pdsm_size: size, max_error: 0.0, ..Default::default() };
        let (pdsm, _) = Pdsm::new(params).prepare(&scene, &light);
        let mut values = vec![f32::NAN; points.len()];
        pdsm.visibility_at(&points, &mut values);
        let layout = &pdsm.windows()[0].layout;
        let caster = square(1.0, 0.6).map(|corner| layout.locate(corner).expect("below the light"));
        let mut sum = 0.0;
        for (&point, v) in points.iter().zip(&values) {
            let at = layout.locate(point).expect("below the light");
            let (mut lit, mut doubtful) = (0, 0);
            for step in layout.steps() {
                let image = caster.map(|corner| corner.texel + step * corner.t);
                let (distance, inside) = from_rim(&image, at.texel + step * at.t);
                lit += usize::from(!inside);
                doubtful += usize::from(distance <= REACH);
            }
            let difference = (v - lit as f32 / 25.0).abs();
            assert!(difference <= doubtful as f32 / 25.0 + 1e-5, "{size}²: off by {difference} at {point}");
            sum += f64::from(difference);
        }
        means.push(sum / points.len() as f64);
    }
    println!("mean |difference| at 64², 128², 256², 512²: {means:.5?}");
    assert!(means.is_sorted_by(|a, b| a > b) && 4.0 * means[3] < means[0], "{means:?}");
}
