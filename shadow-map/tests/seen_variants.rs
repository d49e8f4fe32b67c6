//! The variants that draw for what is seen: `cascaded`, `multi-view`, `alias-free`.

use glam::{Affine3A, Vec3};
use gnomon_shadow_map::{ShadowMap, ShadowMapParams, Variant};
use scene_core::bvh::Bvh;
use scene_core::geometry::ObjectFlags;
use scene_core::reference::{ReferenceSettings, no_progress, reference, valid_pixels};
use scene_core::technique::conformance;
use scene_core::{
    Camera, GBuffer, Light, Report, Scene, TriangleMesh, VisibilityImage, metrics, raster, scenes,
};

const VARIANTS: [Variant; 3] = [Variant::Cascaded, Variant::MultiView, Variant::AliasFree];

fn shade(
    scene: &Scene,
    light: &Light,
    gbuffer: &GBuffer,
    params: ShadowMapParams,
) -> (VisibilityImage, Report) {
    let (prepared, mut report) = ShadowMap::new(params).prepare(scene, light);
    let mut image = VisibilityImage::new(gbuffer.width, gbuffer.height);
    report.merge(&prepared.shade(gbuffer, &mut image));
    (image, report)
}

/// Root mean square errors against ground truth as points and texels grow together.
fn errors_of_multi_view(spec: &str) -> Vec<f64> {
    let setup = scenes::build(spec, 0.0).expect("a built-in scene");
    let (scene, light) = (&setup.scene, &setup.lights[0]);
    let gbuffer = raster::render_gbuffer(scene, &setup.camera.with_size(96, 96));
    let settings = ReferenceSettings { samples: 1024, ..Default::default() };
    let truth = reference(scene, &Bvh::casters(scene), light, &gbuffer, &settings, &no_progress);
    let truth = truth.expect("never stopped").visibility;
    let valid = valid_pixels(&gbuffer, light);
    let error = |(views, map_size)| {
        let params = ShadowMapParams { variant: Variant::MultiView, views, map_size, ..Default::default() };
        let (image, _) = shade(scene, light, &gbuffer, params);
        metrics::errors(&image, &truth, &valid).expect("of one size").rmse
    };
    [(4, 64), (32, 256), (256, 1024)].map(error).to_vec()
}

#[test]
fn multi_view_converges_to_ground_truth() {
    for spec in ["quads", "ball", "log-cabin"] {
        let errors = errors_of_multi_view(spec);
        println!("{spec}: {errors:?}");
        assert!(errors[1] < 0.6 * errors[0] && errors[2] < 0.6 * errors[1], "{spec}: {errors:?}");
        assert!(errors[2] <= 0.01, "{spec}: {errors:?}");
    }
}

#[test]
fn one_view_of_a_point_is_the_hard_map() {
    // No slab lies under it, to which only `hard` fits its map.
    let setup = scenes::build("forest:triangles=20000", 0.0).expect("a built-in scene");
    let light = Light::Point { position: setup.scene.bounds().center() + Vec3::Y * 2.0 };
    let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera.with_size(128, 128));
    let of =
        |variant| shade(&setup.scene, &light, &gbuffer, ShadowMapParams { variant, ..Default::default() }).0;
    assert!(of(Variant::MultiView).bits() == of(Variant::Hard).bits());
}

/// The scene's own light, a sun and a light among the casters; from the scene's camera and from close up.
#[test]
fn skipping_changes_nothing_and_is_counted() {
    for spec in ["forest:triangles=20000", "street", "ball"] {
        let setup = scenes::build(spec, 0.0).expect("a built-in scene");
        let bounds = setup.scene.bounds();
        let sun = Light::Directional { direction: Vec3::new(0.4, -1.0, 0.3), angular_radius: 0.01 };
        let inner = Light::Point { position: bounds.center() + 0.1 * bounds.size() };
        let near = Camera { fov_y: 0.2, ..setup.camera };
        let mut left_out = 0;
        for (light, camera) in [(setup.lights[0], near), (sun, near), (sun, setup.camera), (inner, near)] {
            let gbuffer = raster::render_gbuffer(&setup.scene, &camera.with_size(96, 72));
            for variant in VARIANTS {
                let params = ShadowMapParams { variant, map_size: 128, views: 5, ..Default::default() };
                let (on, report) = shade(&setup.scene, &light, &gbuffer, params);
                let (off, none) =
                    shade(&setup.scene, &light, &gbuffer, ShadowMapParams { skip: false, ..params });
                assert!(on.bits() == off.bits(), "{spec}, {light:?}, {variant:?}");
                assert!(!none.skipped.contains_key("caster triangles outside view"));
                left_out += report.skipped.get("caster triangles outside view").copied().unwrap_or(0);
            }
        }
        assert!(left_out > 0 || spec == "ball", "{spec}: nothing left out");
    }
}

fn plane_with_posts() -> Scene {
    let mut scene = Scene::new();
    let quad = |name: &str, corners: [Vec3; 4]| {
        TriangleMesh::new(name, corners.to_vec(), vec![[0, 1, 2], [0, 2, 3]])
    };
    let ground = quad(
        "ground",
        [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)].map(|(x, z)| Vec3::new(x, 0.0, z) * 500.0),
    );
    scene.add(&ground, Affine3A::IDENTITY, ObjectFlags::default()).expect("finite");
    for i in 0..40 {
        let (x, z) = ((i % 2) as f32 * 2.0 - 1.0, -1.6f32.powf(i as f32 * 0.3));
        let post = quad(
            "post",
            [[-0.3, 0.0], [0.3, 0.0], [0.3, 1.0], [-0.3, 1.0]].map(|[dx, y]| Vec3::new(x + dx, y, z)),
        );
        scene.add(&post, Affine3A::IDENTITY, ObjectFlags::default()).expect("finite");
    }
    scene
}

/// A plain seen from one metre to hundreds: at the same size of map the cascades' shadows are nearer to the exact ones
/// than one map's, no lit plane darkens anywhere, and what the last range lacks the first does not.
#[test]
fn cascades_follow_what_is_seen() {
    let scene = plane_with_posts();
    let light = Light::Directional { direction: Vec3::new(0.5, -0.6, -0.4), angular_radius: 0.0 };
    let camera = Camera {
        eye: Vec3::new(0.0, 1.2, 1.0),
        target: Vec3::new(0.0, 0.6, -4.0),
        up: Vec3::Y,
        fov_y: 1.0,
        near: 0.01,
        far: f32::INFINITY,
        width: 256,
        height: 192,
    };
    let gbuffer = raster::render_gbuffer(&scene, &camera);
    let of = |variant, cascades| {
        let params = ShadowMapParams { variant, cascades, map_size: 256, ..Default::default() };
        shade(&scene, &light, &gbuffer, params).0
    };
    let exact = of(Variant::AliasFree, 1);
    let wrong = |image: &VisibilityImage| {
        image.values.iter().zip(&exact.values).filter(|(v, e)| (*v - *e).abs() > 0.5).count()
    };
    let hard = wrong(&of(Variant::Hard, 1));
    let counts = [1, 2, 4].map(|cascades| wrong(&of(Variant::Cascaded, cascades)));
    println!("wrong pixels: one map {hard}, 1, 2 and 4 cascades {counts:?}");
    assert!(counts[2] < counts[0] && 4 * counts[2] < hard, "{hard} {counts:?}");
    // Without the posts all is lit, through every cascade.
    let mut plane = Scene::new();
    for y in [0.0, -1.0] {
        let corners = [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)]
            .map(|(x, z)| Vec3::new(x * 500.0, y, z * 500.0));
        let mesh = TriangleMesh::new("plane", corners.to_vec(), vec![[0, 1, 2], [0, 2, 3]]);
        plane.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).expect("finite");
    }
    let gbuffer = raster::render_gbuffer(&plane, &camera);
    for degrees in [0.0f32, 45.0, 80.0, 89.9] {
        let tilt = degrees.to_radians();
        let light =
            Light::Directional { direction: Vec3::new(tilt.sin(), -tilt.cos(), 0.1), angular_radius: 0.0 };
        for map_size in [64, 512] {
            let params = ShadowMapParams { variant: Variant::Cascaded, map_size, ..Default::default() };
            let (image, _) = shade(&plane, &light, &gbuffer, params);
            assert_eq!(image.values.iter().filter(|v| **v < 1.0).count(), 0, "{degrees}°, {map_size}");
        }
    }
}

/// Nothing, a point, a line, and coordinates at the end of f32's range: an answer for each pixel that sees a surface.
#[test]
fn scenes_without_area_are_answered() {
    let lights = [
        Light::Directional { direction: Vec3::NEG_Y, angular_radius: 0.02 },
        Light::Point { position: Vec3::ZERO },
        Light::Sphere { center: Vec3::ZERO, radius: 0.5 },
        Light::Rect { center: Vec3::Y, half_u: Vec3::X, half_v: Vec3::Z },
        Light::Spot { position: Vec3::Y, direction: Vec3::NEG_Y, outer: 1.57, inner: 0.1 },
    ];
    let x = Vec3::X;
    for corners in [
        [Vec3::ZERO, x, Vec3::Z],
        [Vec3::ZERO; 3],
        [Vec3::ZERO, x, x * 2.0],
        [x * 1e30, Vec3::Z * 1e30, -x * 1e30],
        [x * 1e-30, Vec3::Z * 1e-30, -x * 1e-30],
    ] {
        for scene in [conformance::triangle(corners), Scene::new()] {
            let gbuffer = raster::render_gbuffer(&scene, &conformance::CAMERA);
            for (variant, light) in VARIANTS.iter().flat_map(|v| lights.iter().map(move |l| (*v, l))) {
                let params = ShadowMapParams { variant, map_size: 32, views: 3, ..Default::default() };
                let (image, _) = shade(&scene, light, &gbuffer, params);
                for (pixel, v) in image.values.iter().enumerate() {
                    assert_eq!(
                        gbuffer.is_seen(pixel),
                        (0.0..=1.0).contains(v),
                        "{variant:?}, {light:?}: {v}"
                    );
                }
                let (prepared, _) = ShadowMap::new(params).prepare(&scene, light);
                let mut free = [7.0; 3];
                prepared.visibility_at(&[Vec3::NAN, Vec3::INFINITY, Vec3::new(0.3, 0.1, 0.2)], &mut free);
                assert!(free[0].is_nan() && free[1].is_nan() && (0.0..=1.0).contains(&free[2]), "{free:?}");
            }
        }
    }
}
