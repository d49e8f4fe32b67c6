//! The region of relevant casters: no shadow ray leaves it, and tracing only what lies in it changes nothing.

use glam::{Affine3A, Mat3, Vec2, Vec3};
use gnomon_scene_core::bvh::{Bvh, Hit, shadow_origin};
use gnomon_scene_core::geometry::{Aabb, ObjectFlags};
use gnomon_scene_core::light::LightPoint;
use gnomon_scene_core::light::sampling::{LightView, SampleKey, stratified};
use gnomon_scene_core::reference::{ReferenceSettings, no_progress, reference};
use gnomon_scene_core::relevance::{
    CasterChunks, CasterRegion, Change, HalfSpace, Receivers, RelevantCasters, Side, TileBounds, TileClasses,
    classify_tiles, depth_slice, objects_among, pyramid, reached_receivers, relevant_casters, told_apart,
    what_remains,
};
use gnomon_scene_core::{Camera, GBuffer, Light, Scene, SceneSetup, TriangleMesh, raster, scenes};

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

/// Rays from what is seen in the pixels that `of` accepts to a few points of the light, as ground truth traces them.
fn for_each_ray(
    scene: &Scene,
    gbuffer: &GBuffer,
    light: &Light,
    magnitude: f32,
    of: impl Fn(usize) -> bool,
    mut ray: impl FnMut(Vec3, LightPoint),
) {
    for pixel in (0..gbuffer.pixel_count()).filter(|&p| gbuffer.is_seen(p) && of(p)) {
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
            let closely = Receivers::seen_closely_by(&scene, &camera, light, &chunks);
            let regions = [
                CasterRegion::of(&scene, &camera, light),
                CasterRegion::of_receivers(&scene, &tiles, light),
                CasterRegion::between(&scene, &closely, light),
            ];
            for region in regions {
                let casters = relevant_casters(&scene, &region, &chunks, |_| true);
                assert_eq!(casters.triangles_kept + casters.triangles_culled, scene.caster_count());
                culled += casters.triangles_culled;
                let part = Bvh::casters(&only(&scene, &casters));
                for_each_ray(
                    &scene,
                    &gbuffer,
                    light,
                    magnitude,
                    |_| true,
                    |origin, target| {
                        let dark = bvh.is_occluded(origin, target);
                        blocked += usize::from(dark);
                        assert_eq!(
                            part.is_occluded(origin, target),
                            dark,
                            "{spec} {seed} {light:?}: {origin}"
                        );
                        stays_inside(&scene, &region, origin, target);
                    },
                );
            }
        }
    }
    assert!(culled > 0 && blocked > 0, "{spec}: {culled} triangles left out, {blocked} rays blocked");
}

/// Looked at closely, what is seen is no looser than by objects' boxes, sometimes tighter, and holds every seen point.
#[test]
fn what_is_seen_closely_holds_every_seen_point() {
    for spec in ["street", "forest:triangles=20000"] {
        let scene = scenes::build(spec, 1.0).expect("a built-in scene").scene;
        let (mut tighter, mut held) = (0, 0);
        for seed in 0..20 {
            let (camera, lights) = random_view(&scene, seed);
            let gbuffer = raster::render_gbuffer(&scene, &camera);
            let light = &lights[seed as usize % lights.len()];
            let loose = Receivers::seen_by(&scene, &camera, light).region().bounds();
            for chunks in [CasterChunks::new(&scene), CasterChunks::default()] {
                let receivers = Receivers::seen_closely_by(&scene, &camera, light, &chunks);
                let close = receivers.region().bounds();
                assert!(close.is_empty() || loose.holds(&close), "{spec} {seed}: {close:?} in {loose:?}");
                tighter += usize::from(close.size().cmplt(loose.size()).any());
                let receives = |p: usize| scene.objects()[gbuffer.object[p] as usize].flags.receives;
                for pixel in (0..gbuffer.pixel_count()).filter(|&p| gbuffer.is_seen(p) && receives(p)) {
                    let position = gbuffer.position[pixel];
                    if light.reaches(position) {
                        held += 1;
                        let point = Aabb { min: position, max: position };
                        assert!(receivers.touches(&point), "{spec} {seed} {light:?}: {position}");
                    }
                }
            }
        }
        assert!(tighter > 0 && held > 10_000, "{spec}: {tighter} tighter, {held} points");
    }
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

/// A part of the receivers, given by its volume, and which pixels belong to it.
type Part<'a> = (Vec<HalfSpace>, Box<dyn Fn(usize) -> bool + 'a>);

/// Cascades of the view, and the faces of a cube around the light if it has a place.
fn parts<'a>(camera: &Camera, gbuffer: &'a GBuffer, light: &Light) -> Vec<Part<'a>> {
    let mut parts: Vec<Part<'a>> = Vec::new();
    let mut depths: Vec<_> = gbuffer.depth.iter().copied().filter(|d| d.is_finite()).collect();
    depths.sort_by(f32::total_cmp);
    let at = |share: usize| depths.get(depths.len() * share / 4).copied().unwrap_or(1.0);
    for [near, far] in [[camera.near, at(1)], [at(1), at(3)], [at(3), f32::INFINITY]] {
        let inside = move |pixel: usize| (near..=far).contains(&gbuffer.depth[pixel]);
        parts.push((depth_slice(camera, near, far), Box::new(inside)));
    }
    if let LightPoint::At(place) = light.center() {
        for backwards in [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z] {
            let (x, y) = backwards.any_orthonormal_pair();
            let axes = Mat3::from_cols(x, y, backwards);
            let inside = move |pixel: usize| {
                let seen = axes.transpose() * (gbuffer.position[pixel] - place);
                seen.x.abs().max(seen.y.abs()) <= -seen.z
            };
            parts.push((pyramid(place, axes, Vec2::NEG_ONE, Vec2::ONE), Box::new(inside)));
        }
    }
    parts
}

/// Casters chosen for a cascade or a face are enough for the receivers in it, and fewer than for all.
fn check_parts(spec: &str, views: u64) {
    let scene = scenes::build(spec, 1.0).expect("a built-in scene").scene;
    let (chunks, bvh) = (CasterChunks::new(&scene), Bvh::casters(&scene));
    let (mut culled, mut of_whole, mut blocked, mut nobody) = (0, 0, 0, 0);
    for seed in 0..views {
        let (camera, lights) = random_view(&scene, seed);
        let gbuffer = raster::render_gbuffer(&scene, &camera);
        let magnitude = scene.bounds().magnitude().max(camera.eye.abs().max_element());
        let light = &lights[seed as usize % lights.len()];
        let seen = Receivers::seen_by(&scene, &camera, light);
        let whole = relevant_casters(&scene, &CasterRegion::between(&scene, &seen, light), &chunks, |_| true);
        let parts = parts(&camera, &gbuffer, light);
        for (volume, belongs) in &parts {
            let receivers = seen.clone().inside(volume);
            let among = objects_among(&scene, &receivers);
            let pixels = (0..gbuffer.pixel_count()).filter(|&p| gbuffer.is_seen(p) && belongs(p));
            for pixel in pixels.filter(|&p| light.reaches(gbuffer.position[p])) {
                let object = gbuffer.object[pixel];
                assert!(among.contains(&object), "{spec} {seed} {light:?}: {object} is seen in the part");
            }
            nobody += usize::from(receivers.is_empty());
            let region = CasterRegion::between(&scene, &receivers, light);
            let casters = relevant_casters(&scene, &region, &chunks, |_| true);
            culled += casters.triangles_culled;
            of_whole += whole.triangles_culled;
            let part = Bvh::casters(&only(&scene, &casters));
            for_each_ray(&scene, &gbuffer, light, magnitude, belongs, |origin, target| {
                let dark = bvh.is_occluded(origin, target);
                blocked += usize::from(dark);
                assert_eq!(part.is_occluded(origin, target), dark, "{spec} {seed} {light:?}: {origin}");
            });
        }
    }
    assert!(blocked > 0 && nobody > 0, "{spec}: {blocked} rays blocked, {nobody} parts without receivers");
    assert!(culled > of_whole, "{spec}: {culled} triangles left out by part, {of_whole} by the whole view");
}

#[test]
fn cascades_and_cube_faces_by_rays() {
    check_parts("street", 10);
    check_parts("forest:triangles=60000", 10);
}

#[test]
fn a_volume_of_no_sense_leaves_every_receiver_in() {
    let scene = two_cubes();
    let light = Light::Point { position: Vec3::splat(9.0) };
    let all = Receivers::within(&scene, &[scene.bounds()], &light);
    let volume = all.region().volume();
    let nonsense = [
        depth_slice(&Camera { eye: Vec3::NAN, ..anywhere() }, 1.0, 2.0),
        pyramid(Vec3::INFINITY, Mat3::IDENTITY, Vec2::NEG_ONE, Vec2::ONE),
        pyramid(Vec3::ZERO, Mat3::ZERO, Vec2::NEG_ONE, Vec2::ONE),
        depth_slice(&anywhere(), f32::NAN, f32::INFINITY),
    ];
    for planes in nonsense {
        assert_eq!(all.clone().inside(&planes).region().volume(), volume);
    }
    let behind = all.inside(&depth_slice(&anywhere(), -3.0, -2.0));
    assert!(objects_among(&scene, &behind).is_empty() && behind.is_empty());
}

/// What stays when something moves is what the frame before would have made.
#[test]
fn what_is_said_to_remain_is_the_same_when_made_again() {
    let setups = [1.0, 1.5].map(|time| scenes::build("street", time).expect("a built-in scene"));
    let [before, after] = &setups;
    let objects = (0..).zip(before.scene.objects());
    let moved: Vec<u32> = objects.filter(|(_, o)| o.flags.dynamic).map(|(id, _)| id).collect();
    let camera = before.camera.with_size(64, 64);
    let aside = Camera { eye: camera.eye + Vec3::new(0.4, 1.0, -3.0), ..camera };
    let sun = before.lights[0];
    let lower = Light::Directional { direction: Vec3::new(0.5, -0.3, -0.9), angular_radius: 0.01 };
    let frame = |setup: &SceneSetup, camera: &Camera, light: &Light| Frame::new(&setup.scene, camera, light);
    let first = frame(before, &camera, &sun);
    for (second, change) in [
        (frame(before, &aside, &sun), Change { camera: true, ..Default::default() }),
        (frame(before, &camera, &lower), Change { light: true, ..Default::default() }),
        (frame(after, &camera, &sun), Change { objects: &moved, ..Default::default() }),
    ] {
        let remake = what_remains(&before.scene, change);
        let Frame { gbuffer, tiles, chunks, traced, backdrops, region, casters, visibility, classes } =
            &second;
        for (what, remade, same) in [
            ("G-buffer", remake.gbuffer, format!("{gbuffer:?}") == format!("{:?}", first.gbuffer)),
            ("tiles", remake.gbuffer, *tiles == first.tiles),
            ("chunks", remake.caster_bounds, *chunks == first.chunks),
            ("tree", remake.caster_bounds, *traced == first.traced),
            ("backdrops", remake.preparation, *backdrops == first.backdrops),
            ("region", remake.view_preparation, *region == first.region),
            ("casters", remake.view_preparation, *casters == first.casters),
            ("visibility", remake.visibility, *visibility == first.visibility),
            ("classes", remake.visibility, *classes == first.classes),
        ] {
            assert!(remade || same, "{what} is said to remain: {change:?}");
        }
        // What is to be made again does differ, so that the comparison above can fail.
        assert!(*visibility != first.visibility, "{change:?}");
        assert_eq!(*chunks == first.chunks, !remake.caster_bounds, "{change:?}");
        assert_eq!(*tiles == first.tiles, !remake.gbuffer, "{change:?}");
    }
}

/// What a frame makes.
struct Frame {
    gbuffer: GBuffer,
    tiles: TileBounds,
    chunks: CasterChunks,
    /// Closest hits of a few rays.
    traced: Vec<Option<Hit>>,
    /// Objects without anything behind them, by where their triangles start.
    backdrops: Vec<usize>,
    region: Vec<HalfSpace>,
    casters: RelevantCasters,
    visibility: Vec<u32>,
    classes: TileClasses,
}

impl Frame {
    fn new(scene: &Scene, camera: &Camera, light: &Light) -> Self {
        let (gbuffer, chunks) = (raster::render_gbuffer(scene, camera), CasterChunks::new(scene));
        let tiles = TileBounds::of_receivers(scene, &gbuffer);
        let bvh = Bvh::casters(scene);
        let region = CasterRegion::of(scene, camera, light);
        let casters = relevant_casters(scene, &region, &chunks, |_| true);
        let settings = ReferenceSettings { samples: 4, ..Default::default() };
        let truth = reference(scene, &bvh, light, &gbuffer, &settings, &no_progress).expect("not cancelled");
        let rays = (0..400).map(|i| Vec3::new((i % 20) as f32 - 10.0, -3.0, (i / 20) as f32 - 20.0));
        Self {
            traced: rays.map(|d| bvh.closest_hit(Vec3::Y * 15.0, d, 0.0, f32::INFINITY)).collect(),
            backdrops: told_apart(scene, light, 1e-4).backdrops.iter().map(|o| o.triangles.start).collect(),
            classes: classify_tiles(scene, &bvh, light, &gbuffer, &tiles),
            region: region.planes().to_vec(),
            visibility: truth.visibility.bits(),
            gbuffer,
            tiles,
            chunks,
            casters,
        }
    }
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

fn anywhere() -> Camera {
    Camera {
        eye: Vec3::ZERO,
        target: Vec3::Z,
        up: Vec3::Y,
        fov_y: 0.8,
        near: 0.1,
        far: f32::INFINITY,
        width: 8,
        height: 8,
    }
}

#[test]
fn nothing_seen_needs_no_casters() {
    let scene = two_cubes();
    let light = Light::Directional { direction: Vec3::NEG_Y, angular_radius: 0.01 };
    let away = Camera { eye: Vec3::Z * 50.0, target: Vec3::Z * 60.0, ..anywhere() };
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
