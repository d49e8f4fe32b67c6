//! The region of relevant casters: no shadow ray leaves it, and tracing only what lies in it changes nothing.

use glam::{Affine3A, Vec3};
use gnomon_scene_core::bvh::{Bvh, shadow_origin};
use gnomon_scene_core::geometry::{Aabb, ObjectFlags};
use gnomon_scene_core::light::LightPoint;
use gnomon_scene_core::light::sampling::{LightView, SampleKey, stratified};
use gnomon_scene_core::relevance::{
    CasterChunks, CasterRegion, RelevantCasters, Side, TileBounds, reached_receivers, relevant_casters,
};
use gnomon_scene_core::{Camera, GBuffer, Light, Scene, TriangleMesh, raster, scenes};

/// A camera somewhere in `scene` that looks anywhere, and lights of every kind around it.
fn random_view(scene: &Scene, seed: u64) -> (Camera, Vec<Light>) {
    let mut state = seed * 2 + 1;
    let mut unit = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1u64 << 24) as f32
    };
    for _ in 0..8 {
        unit();
    }
    let bounds = scene.bounds();
    let mut place = |low: f32, high: f32| {
        let share = Vec3::from_array([(); 3].map(|()| low + (high - low) * unit()));
        bounds.min + bounds.size() * share
    };
    let (eye, target, near_light) = (place(0.2, 0.8), place(0.2, 0.8), place(0.1, 0.9));
    let far_light = place(-0.5, 1.5).with_y(bounds.max.y * 1.5);
    let size = bounds.size().max_element();
    let far = if unit() < 0.5 { f32::INFINITY } else { size * (0.1 + unit()) };
    let fov_y = 0.2 + 1.4 * unit();
    let camera = Camera { eye, target, up: Vec3::Y, fov_y, near: size * 1e-3, far, width: 48, height: 36 };
    let towards = (far_light - bounds.center()).normalize();
    let lights = vec![
        Light::Directional { direction: -towards, angular_radius: 0.0 },
        Light::Directional { direction: -towards, angular_radius: 0.1 },
        Light::Point { position: near_light },
        Light::Spot { position: far_light, direction: -towards, outer: 0.5, inner: 0.2 },
        Light::Sphere { center: far_light, radius: size * 0.05 },
        Light::Sphere { center: near_light, radius: size * 0.1 },
        Light::Rect { center: far_light, half_u: Vec3::X * size * 0.04, half_v: Vec3::Z * size * 0.08 },
        Light::Disk { center: near_light, normal: towards, radius: size * 0.03 },
    ];
    (camera, lights)
}

/// Rays from what is seen to a few points of the light, as ground truth traces them.
fn for_each_ray(
    scene: &Scene,
    gbuffer: &GBuffer,
    light: &Light,
    magnitude: f32,
    mut ray: impl FnMut(Vec3, LightPoint),
) {
    for pixel in (0..gbuffer.pixel_count()).filter(|&p| gbuffer.is_seen(p)) {
        let position = gbuffer.position[pixel];
        if !scene.objects()[gbuffer.object[pixel] as usize].flags.receives || !light.reaches(position) {
            continue;
        }
        let mut points = [LightPoint::At(Vec3::ZERO); 4];
        stratified(&LightView::new(light, position), SampleKey::new(3, pixel as u64), &mut points);
        let origin = shadow_origin(position, gbuffer.normal[pixel], magnitude);
        points.into_iter().for_each(|point| ray(origin, point));
    }
}

/// A scene of only these triangles.
fn only(scene: &Scene, casters: &RelevantCasters) -> Scene {
    let mut part = Scene::new();
    let triangles: Vec<_> = casters
        .ranges
        .iter()
        .flat_map(|range| range.clone())
        .filter(|&t| scene.objects()[scene.object_of(t) as usize].flags.casts)
        .map(|t| scene.triangles()[t])
        .collect();
    let mesh = TriangleMesh::new("kept", scene.positions().to_vec(), triangles);
    part.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).expect("as sound as the scene");
    part
}

fn check(spec: &str, views: u64) {
    let scene = scenes::build(spec, 1.0).expect("a built-in scene").scene;
    let (chunks, bvh) = (CasterChunks::new(&scene), Bvh::casters(&scene));
    let (mut culled, mut blocked) = (0, 0);
    for seed in 0..views {
        let (camera, lights) = random_view(&scene, seed);
        let gbuffer = raster::render_gbuffer(&scene, &camera);
        let tiles = TileBounds::of_receivers(&scene, &gbuffer).boxes();
        let magnitude = scene.bounds().magnitude().max(camera.eye.abs().max_element());
        // Two kinds of light a view; all of them come up.
        for light in lights.iter().cycle().skip(seed as usize * 2 % lights.len()).take(2) {
            let regions =
                [CasterRegion::of(&scene, &camera, light), CasterRegion::of_receivers(&scene, &tiles, light)];
            for region in regions {
                let casters = relevant_casters(&scene, &region, &chunks, |_| true);
                assert_eq!(casters.triangles_kept + casters.triangles_culled, scene.caster_count());
                culled += casters.triangles_culled;
                let part = Bvh::casters(&only(&scene, &casters));
                for_each_ray(&scene, &gbuffer, light, magnitude, |origin, target| {
                    let dark = bvh.is_occluded(origin, target);
                    blocked += usize::from(dark);
                    assert_eq!(part.is_occluded(origin, target), dark, "{spec} {seed} {light:?}: {origin}");
                    stays_inside(&scene, &region, origin, target);
                });
            }
        }
    }
    assert!(culled > 0 && blocked > 0, "{spec}: {culled} triangles left out, {blocked} rays blocked");
}

/// Points along a shadow ray lie in the region as long as they lie in the casters' bounds.
fn stays_inside(scene: &Scene, region: &CasterRegion, origin: Vec3, target: LightPoint) {
    let bounds = scene.bounds();
    let (direction, end) = target.ray_from(origin);
    let end = if end.is_finite() { end } else { bounds.diagonal() };
    for i in 0..=4 {
        let p = origin + direction * (end * i as f32 / 4.0);
        if bounds.min.cmple(p).all() && bounds.max.cmpge(p).all() {
            assert!(region.touches(&Aabb { min: p, max: p }), "{p} of a ray from {origin} to {target:?}");
        }
    }
}

#[test]
fn street_by_rays() {
    check("street", 16);
}

#[test]
fn park_by_rays() {
    check("park:leaves=1000", 16);
}

#[test]
fn forest_by_rays() {
    check("forest:triangles=60000", 16);
}

fn two_cubes() -> Scene {
    let mut scene = Scene::new();
    let cube = |at: f32| {
        let corner = |i: u32| Vec3::new(at + (i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32);
        TriangleMesh::new("cube", (0..8).map(corner).collect(), vec![[0, 1, 2], [4, 5, 6], [0, 3, 7]])
    };
    for at in [0.0, 20.0] {
        scene.add(&cube(at), Affine3A::IDENTITY, ObjectFlags::default()).unwrap();
    }
    scene
}

#[test]
fn the_region_is_the_hull_of_receivers_and_light() {
    // A unit cube and a point 3 above its top's centre: a cube and a pyramid.
    let light = Light::Point { position: Vec3::new(0.5, 4.0, 0.5) };
    let mut scene = two_cubes();
    // Casters all around, so that their bounds do not cut.
    let mesh = TriangleMesh::new("sky", vec![Vec3::splat(-9.0), Vec3::splat(9.0), Vec3::X], vec![[0, 1, 2]]);
    scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags { receives: false, ..Default::default() }).unwrap();
    let region = CasterRegion::of_receivers(&scene, &[Aabb { min: Vec3::ZERO, max: Vec3::ONE }], &light);
    let volume = region.polyhedron().volume();
    assert!((volume - 2.0).abs() < 0.01, "{volume}");
    let at = |x: f32, y: f32| Aabb { min: Vec3::new(x, y, 0.5), max: Vec3::new(x, y, 0.5) };
    assert!(region.touches(&at(0.5, 3.9)) && region.touches(&at(0.7, 2.0)));
    assert!(
        !region.touches(&at(0.5, 4.1)) && !region.touches(&at(0.9, 2.0)) && !region.touches(&at(0.5, -0.1))
    );
    let inner = Aabb { min: Vec3::splat(0.2), max: Vec3::splat(0.8) };
    assert_eq!(region.side_of(&inner), Side::Inside);
    assert!(!region.touches(&Aabb::EMPTY));
}

#[test]
fn a_spot_reaches_what_its_cone_holds() {
    let spot =
        |direction| Light::Spot { position: Vec3::new(0.5, 9.0, 0.5), direction, outer: 0.3, inner: 0.1 };
    assert_eq!(reached_receivers(&two_cubes(), &spot(Vec3::NEG_Y)), [0]);
    assert_eq!(reached_receivers(&two_cubes(), &spot(Vec3::new(20.0, -8.5, 0.0))), [1]);
    assert!(reached_receivers(&two_cubes(), &spot(Vec3::Y)).is_empty());
    assert_eq!(reached_receivers(&two_cubes(), &Light::Point { position: Vec3::ONE }), [0, 1]);
}

#[test]
fn nothing_seen_needs_no_casters() {
    let scene = two_cubes();
    let light = Light::Directional { direction: Vec3::NEG_Y, angular_radius: 0.01 };
    let away = Camera {
        eye: Vec3::new(0.0, 0.0, 50.0),
        target: Vec3::new(0.0, 0.0, 60.0),
        up: Vec3::Y,
        fov_y: 0.8,
        near: 0.1,
        far: f32::INFINITY,
        width: 8,
        height: 8,
    };
    for region in [CasterRegion::of(&scene, &away, &light), CasterRegion::of_receivers(&scene, &[], &light)] {
        assert!(region.is_empty());
        let casters = relevant_casters(&scene, &region, &CasterChunks::new(&scene), |_| true);
        assert_eq!((casters.objects_culled, casters.triangles_culled), (2, 6));
        assert!(casters.ranges.is_empty());
    }
    assert!(CasterRegion::of(&Scene::new(), &away, &light).is_empty());
    // A camera that makes no picture culls nothing it cannot prove, and does not panic.
    let _ = CasterRegion::of(&scene, &Camera { eye: Vec3::NAN, ..away }, &light);
}
