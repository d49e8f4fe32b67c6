//! The G-buffer and depth passes against brute-force ray casting in f64.

use std::sync::Arc;
use std::time::Instant;

use glam::{Affine3A, DMat4, DVec3, Mat4, Vec2, Vec3, Vec4};
use gnomon_scene_core::geometry::{AlphaMask, ObjectFlags, Wrap};
use gnomon_scene_core::gpu::{
    ChosenRuns, DepthIds, DepthPass, DepthTarget, DepthUniform, GBufferPass, GBufferTargets, Gpu, RUN,
    Recorder, SceneBuffers, StageTimer, WrittenProjection, filled_buffer, storage_buffer, testing,
};
use gnomon_scene_core::raster::render_gbuffer;
use gnomon_scene_core::{Camera, GBuffer, Scene, TriangleMesh};

/// Snapped coordinates have at least 4 bits below a pixel on every adapter, so that a
/// triangle's outline may lie this far from where it is, in pixels.
const SNAP: f64 = 1.0 / 16.0;

fn quad(name: &str, corner: Vec3, u: Vec3, v: Vec3) -> TriangleMesh {
    let positions = vec![corner, corner + u, corner + u + v, corner + v];
    let mut mesh = TriangleMesh::new(name, positions, vec![[0, 1, 2], [0, 2, 3]]);
    mesh.uvs = vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
    mesh
}

/// A floor that reaches behind the camera, a tilted quad with holes, a small wall that does not cast; `offset`
/// moves all of it.
fn scene(offset: Vec3) -> Scene {
    let mut scene = Scene::new();
    let mut holes =
        quad("holes", Vec3::new(-1.5, 0.2, -1.0), Vec3::new(2.0, 0.3, 0.1), Vec3::new(0.2, 1.6, -0.7));
    let alpha: Vec<u8> = (0..16).map(|i| if (i + i / 4) % 2 == 0 { 255 } else { 0 }).collect();
    holes.alpha = AlphaMask::from_alpha(4, 4, &alpha, 0.5, [Wrap::Repeat; 2]).map(Arc::new);
    let mut ball = TriangleMesh::new("pyramid", Vec::new(), Vec::new());
    let base = [Vec3::X, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Z];
    ball.positions = base.iter().copied().chain([Vec3::Y * 1.2]).collect();
    ball.triangles = (0..4).map(|i| [i, (i + 1) % 4, 4]).collect();
    let floor = quad("floor", Vec3::new(-60.0, 0.0, -60.0), Vec3::X * 120.0, Vec3::Z * 120.0);
    let wall = quad("wall", Vec3::new(1.2, 0.0, -2.0), Vec3::Z * 1.5, Vec3::Y * 2.5);
    let no_cast = ObjectFlags { casts: false, ..Default::default() };
    let at = |place: Vec3| Affine3A::from_translation(place + offset);
    scene.add(&floor, at(Vec3::ZERO), ObjectFlags::default()).unwrap();
    scene.add(&TriangleMesh::default(), at(Vec3::ZERO), ObjectFlags::default()).unwrap();
    scene.add(&holes, at(Vec3::ZERO), ObjectFlags::default()).unwrap();
    scene.add(&wall, at(Vec3::ZERO), no_cast).unwrap();
    scene.add(&ball, at(Vec3::new(0.4, 0.0, 0.3)), ObjectFlags::default()).unwrap();
    scene
}

fn camera(offset: Vec3, far: f32) -> Camera {
    Camera {
        eye: Vec3::new(1.0, 1.7, 5.0) + offset,
        target: Vec3::new(0.0, 0.6, 0.0) + offset,
        up: Vec3::Y,
        fov_y: 0.8,
        near: 0.05,
        far,
        width: 160,
        height: 100,
    }
}

/// A triangle's plane met by a ray: the parameter, and barycentric coordinates, which are all positive inside.
fn meet(corners: [DVec3; 3], origin: DVec3, direction: DVec3) -> Option<(f64, [f64; 3])> {
    let [a, b, c] = corners;
    let normal = (b - a).cross(c - a);
    let t = normal.dot(a - origin) / normal.dot(direction);
    let p = origin + direction * t;
    let area = normal.length_squared();
    let v = normal.dot((c - b).cross(p - b)) / area;
    let w = normal.dot((a - c).cross(p - c)) / area;
    t.is_finite().then_some((t, [v, w, 1.0 - v - w]))
}

/// The nearest hit within `range` as triangle, parameter and how clearly it is the one: the least of all
/// barycentric coordinates decided about on the way.
fn cast(
    scene: &Scene,
    ray: (DVec3, DVec3),
    range: [f64; 2],
    accept: impl Fn(u32) -> bool,
) -> (Option<(usize, f64)>, f64) {
    let (mut best, mut clear) = (None::<(usize, f64)>, f64::INFINITY);
    for triangle in 0..scene.triangles().len() {
        let object = scene.object_of(triangle);
        if !accept(object) {
            continue;
        }
        let corners = scene.corners(triangle).map(|p| p.as_dvec3());
        let Some((t, weights)) = meet(corners, ray.0, ray.1) else { continue };
        let least = weights.into_iter().fold(f64::INFINITY, f64::min);
        if t < range[0] || t > range[1] {
            continue;
        }
        clear = clear.min(least.abs());
        if least < 0.0 {
            continue;
        }
        if let Some(mask) = &scene.objects()[object as usize].alpha {
            let uv = [0, 1, 2].map(|i| scene.uvs()[scene.triangles()[triangle][i] as usize].as_dvec2());
            let uv = uv[0] * weights[0] + uv[1] * weights[1] + uv[2] * weights[2];
            let texel = uv * 4.0;
            clear = clear.min((texel - texel.round()).abs().min_element());
            if !mask.is_solid(uv.as_vec2()) {
                continue;
            }
        }
        if best.is_none_or(|(_, nearest)| t < nearest) {
            best = Some((triangle, t));
        }
    }
    (best, clear)
}

fn draw_gbuffer(gpu: &Gpu, scene: &Scene, camera: &Camera) -> GBuffer {
    let buffers = SceneBuffers::new(&gpu.device, scene).unwrap();
    let targets = GBufferTargets::new(&gpu.device, camera.width, camera.height);
    let mut encoder = gpu.encoder();
    gpu.scoped("the G-buffer", || {
        let mut pass = GBufferPass::new(&gpu.device);
        let mut recorder = Recorder::new(&gpu.device, &gpu.queue, &mut encoder);
        pass.record(&mut recorder, "gbuffer", &buffers.view(Some(scene)), camera, &targets);
    })
    .unwrap();
    gpu.submit(encoder).unwrap();
    gpu.read_gbuffer(&targets, camera).unwrap()
}

/// Where the outline is not near, the triangle is that of the pixel's ray; depth, position and normal then are
/// within rounding of it: the plane's normal and distance carry a few dozen roundings relative to the distance
/// of its nearest corner, divided by the cosine under which it is seen.
#[test]
fn the_gbuffer_is_what_rays_meet() {
    let Some(gpu) = testing::gpu() else { return };
    for (offset, far) in
        [(Vec3::ZERO, 90.0), (Vec3::ZERO, f32::INFINITY), (Vec3::new(3000.0, -500.0, 8000.0), 90.0)]
    {
        let (scene, camera) = (scene(offset), camera(offset, far));
        let gbuffer = draw_gbuffer(&gpu, &scene, &camera);
        let (mut compared, mut seen, mut objects) = (0, 0, [0; 5]);
        for pixel in 0..gbuffer.pixel_count() {
            let (x, y) = (pixel as u32 % camera.width, pixel as u32 / camera.width);
            let direction = camera.ray_direction(Vec2::new(x as f32 + 0.5, y as f32 + 0.5)).as_dvec3();
            let eye = camera.eye.as_dvec3();
            let range = [f64::from(camera.near), f64::from(camera.far)];
            let (hit, clear) = cast(&scene, (eye, direction), range, |_| true);
            // A pixel of the floor spans up to a hundredth of it, one of the others more of them.
            if clear < 2.0 * SNAP * 0.02 {
                continue;
            }
            compared += 1;
            let Some((triangle, t)) = hit else {
                assert!(!gbuffer.is_seen(pixel) && gbuffer.object[pixel] == GBuffer::NOTHING, "{x} {y}");
                assert!(gbuffer.position[pixel].is_nan() && gbuffer.depth[pixel] == f32::INFINITY);
                continue;
            };
            seen += 1;
            assert_eq!(gbuffer.triangle[pixel] as usize, triangle, "{x} {y}");
            assert_eq!(gbuffer.object[pixel], scene.object_of(triangle));
            objects[gbuffer.object[pixel] as usize] += 1;
            let [a, b, c] = scene.corners(triangle).map(|p| p.as_dvec3());
            let normal = (b - a).cross(c - a).normalize();
            let cosine = normal.dot(direction.normalize());
            let reach = [a, b, c].map(|p| (p - eye).length()).into_iter().fold(f64::INFINITY, f64::min) + t;
            let bound = 32.0 * f64::from(f32::EPSILON) * reach / cosine.abs();
            let depth_error = (f64::from(gbuffer.depth[pixel]) - t).abs();
            assert!(depth_error <= bound, "{x} {y}: depth off by {depth_error}, bound {bound}");
            let position = eye + direction * t;
            let position_error = (gbuffer.position[pixel].as_dvec3() - position).length();
            let ulp = f64::from(f32::EPSILON) * position.length();
            assert!(position_error <= 2.0 * bound + 2.0 * ulp, "{x} {y}: position off by {position_error}");
            let turned = if cosine > 0.0 { -normal } else { normal };
            let normal_error = (gbuffer.normal[pixel].as_dvec3() - turned).length();
            assert!(normal_error < 16.0 * f64::from(f32::EPSILON), "{x} {y}: normal off by {normal_error}");
        }
        let all = gbuffer.pixel_count();
        assert!(compared * 10 > all * 8, "only {compared} of {all} pixels are clear of an outline");
        assert!(seen > all / 2 && seen < compared, "{seen} of {compared}");
        assert!(objects[0] > 0 && objects[2] > 0 && objects[3] > 0 && objects[4] > 0, "{objects:?}");
    }
}

#[test]
fn an_empty_scene_is_nothing_seen() {
    let Some(gpu) = testing::gpu() else { return };
    let gbuffer = draw_gbuffer(&gpu, &Scene::new(), &camera(Vec3::ZERO, 10.0));
    assert_eq!((gbuffer.width, gbuffer.height), (160, 100));
    assert!((0..gbuffer.pixel_count()).all(|pixel| !gbuffer.is_seen(pixel)));
    assert!(gbuffer.position.iter().all(|p| p.is_nan()) && gbuffer.depth.iter().all(|d| d.is_infinite()));
}

/// Depth targets with ids, of `layers` square layers.
fn depth_textures(gpu: &Gpu, side: u32, layers: u32) -> [wgpu::Texture; 2] {
    [wgpu::TextureFormat::Depth32Float, wgpu::TextureFormat::R32Uint].map(|format| {
        gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size: wgpu::Extent3d { width: side, height: side, depth_or_array_layers: layers },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        })
    })
}

fn layer(texture: &wgpu::Texture, layer: u32) -> wgpu::TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::D2),
        base_array_layer: layer,
        array_layer_count: Some(1),
        ..Default::default()
    })
}

/// The matrices of a sun, a lamp and a cube's face; reversed Z.
fn projections(offset: Vec3) -> [Mat4; 3] {
    let camera = |eye: Vec3, target: Vec3, fov_y, near, far, up| {
        let (eye, target) = (eye + offset, target + offset);
        Camera { eye, target, up, fov_y, near, far, width: SIDE, height: SIDE }
    };
    let sun = camera(Vec3::new(2.0, 6.0, 3.0), Vec3::ZERO, 1.0, 0.5, 12.0, Vec3::Y);
    // Parallel: 6 units wide, depth 1 at view depth 0.5 and 0 at 12.
    let parallel =
        Mat4::from_cols(Vec4::X / 3.0, Vec4::Y / 3.0, Vec4::Z / 11.5, Vec4::new(0.0, 0.0, 12.0 / 11.5, 1.0));
    let face = camera(
        Vec3::new(0.2, 2.5, 0.2),
        Vec3::new(0.2, 1.5, 0.2),
        std::f32::consts::FRAC_PI_2,
        0.1,
        f32::INFINITY,
        Vec3::Z,
    );
    [
        parallel * sun.view_from_world(),
        camera(Vec3::new(-1.0, 4.0, 3.0), Vec3::ZERO, 0.9, 0.25, 40.0, Vec3::Y).projection_from_world(),
        face.projection_from_world(),
    ]
}

const SIDE: u32 = 128;

/// Holds a depth map against ray casting: depth within what moving the sample by [`SNAP`] pixels makes, ids equal
/// where the outline is not near. Returns how many texels hold something.
fn check_map(
    scene: &Scene,
    clip_from_world: Mat4,
    depth: &[f32],
    ids: Option<(&[u32], DepthIds)>,
    accept: impl Fn(u32) -> bool,
) -> usize {
    let clip_from_world = clip_from_world.as_dmat4();
    let world_from_clip: DMat4 = clip_from_world.inverse();
    let at = |x: f64, y: f64| {
        let ndc = DVec3::new(x / f64::from(SIDE) * 2.0 - 1.0, 1.0 - y / f64::from(SIDE) * 2.0, 1.0);
        let near = world_from_clip.project_point3(ndc);
        (near, world_from_clip.project_point3(ndc.with_z(0.5)) - near)
    };
    let mut filled = 0;
    for texel in 0..(SIDE * SIDE) as usize {
        let (x, y) = (texel as u32 % SIDE, texel as u32 / SIDE);
        let center = (f64::from(x) + 0.5, f64::from(y) + 0.5);
        let ray = at(center.0, center.1);
        let (hit, clear) = cast(scene, ray, [0.0, f64::INFINITY], &accept);
        if clear < 2.0 * SNAP * 0.02 {
            continue;
        }
        let Some((triangle, t)) = hit else {
            assert_eq!(depth[texel], 0.0, "{x} {y}");
            continue;
        };
        filled += 1;
        let expected = clip_from_world.project_point3(ray.0 + ray.1 * t).z;
        // The plane's depth a snapping step away.
        let corners = scene.corners(triangle).map(|p| p.as_dvec3());
        let slope: f64 = [(SNAP, 0.0), (0.0, SNAP)]
            .into_iter()
            .map(|(dx, dy)| {
                let ray = at(center.0 + dx, center.1 + dy);
                let t = meet(corners, ray.0, ray.1).map_or(0.0, |(t, _)| t);
                (clip_from_world.project_point3(ray.0 + ray.1 * t).z - expected).abs()
            })
            .sum();
        let error = (f64::from(depth[texel]) - expected).abs();
        // Far off the origin the matrix itself has been rounded to f32 before anyone drew with it.
        let rounding = 16.0 * f64::from(f32::EPSILON);
        assert!(error <= slope + rounding, "{x} {y}: depth off by {error}, slope {slope}");
        if let Some((ids, kind)) = ids {
            let id = if kind == DepthIds::Triangle { triangle as u32 } else { scene.object_of(triangle) };
            assert_eq!(ids[texel], id, "{x} {y}");
        }
    }
    filled
}

#[test]
fn depth_maps_are_what_rays_from_the_light_meet() {
    let Some(gpu) = testing::gpu() else { return };
    let scene = scene(Vec3::ZERO);
    let buffers = SceneBuffers::new(&gpu.device, &scene).unwrap();
    let casts = |object: u32| scene.objects()[object as usize].flags.casts;
    for kind in [DepthIds::None, DepthIds::Object, DepthIds::Triangle] {
        let [depth, ids] = depth_textures(&gpu, SIDE, 3);
        let mut pass = DepthPass::new(&gpu.device, kind, None);
        let mut encoder = gpu.encoder();
        let views = [0, 1, 2].map(|i| (layer(&depth, i), layer(&ids, i)));
        let targets: Vec<_> = views
            .iter()
            .zip(projections(Vec3::ZERO))
            .map(|((depth, ids), clip)| DepthTarget { ids: Some(ids), ..DepthTarget::new(depth, clip) })
            .collect();
        gpu.scoped("depth maps", || {
            let mut recorder = Recorder::new(&gpu.device, &gpu.queue, &mut encoder);
            pass.record(&mut recorder, "prepare.depth", &buffers.view(None), &targets);
        })
        .unwrap();
        gpu.submit(encoder).unwrap();
        for (index, clip) in (0..).zip(projections(Vec3::ZERO)) {
            let depth: Vec<f32> = gpu.read_texture(&depth, index).unwrap();
            let read = |kind| (kind != DepthIds::None).then(|| gpu.read_texture(&ids, index).unwrap());
            let ids: Option<Vec<u32>> = read(kind);
            let filled = check_map(&scene, clip, &depth, ids.as_deref().map(|ids| (ids, kind)), casts);
            assert!(filled > (SIDE * SIDE / 2) as usize, "{kind:?} {index}: {filled}");
        }
    }
}

#[test]
fn a_projection_that_lies_in_a_buffer_draws_the_same_map() {
    let Some(gpu) = testing::gpu() else { return };
    let scene = scene(Vec3::ZERO);
    let buffers = SceneBuffers::new(&gpu.device, &scene).unwrap();
    let clip = projections(Vec3::ZERO)[0];
    let mut words = vec![0u8; 256];
    words.extend(bytemuck::bytes_of(&DepthUniform::new(clip, buffers.view(None).bounds.center())));
    let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: words.len() as u64,
        usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    gpu.queue.write_buffer(&buffer, 0, &words);
    let map = |written| {
        let [depth, _] = depth_textures(&gpu, SIDE, 1);
        let view = layer(&depth, 0);
        // Without the buffer's this one would put everything on one place.
        let given = if written { glam::Mat4::ZERO } else { clip };
        let written = written.then_some(WrittenProjection { buffer: &buffer, offset: 256 });
        let target = DepthTarget { written, ..DepthTarget::new(&view, given) };
        let mut encoder = gpu.encoder();
        let mut recorder = Recorder::new(&gpu.device, &gpu.queue, &mut encoder);
        let mut pass = DepthPass::new(&gpu.device, DepthIds::None, None);
        pass.record(&mut recorder, "prepare.depth", &buffers.view(None), &[target]);
        gpu.submit(encoder).unwrap();
        gpu.read_texture::<u32>(&depth, 0).unwrap()
    };
    assert!(map(true) == map(false));
}

/// Runs of a few triangles, and none: the floor is left out, the quad with holes is drawn as `triangles` say.
#[test]
fn chosen_runs_are_drawn_in_the_place_of_solid_triangles() {
    let Some(gpu) = testing::gpu() else { return };
    let scene = scene(Vec3::ZERO);
    let buffers = SceneBuffers::new(&gpu.device, &scene).unwrap();
    // Behind 256 bytes of another target's, as its arguments are.
    let mut runs = vec![0u32; 64];
    runs.extend([6, 7, 8, 10]);
    let arguments = [[0u32; 4], [3 * RUN * 2, 1, 0, 0]];
    let runs = storage_buffer(&gpu.device, "runs", bytemuck::cast_slice(&runs)).unwrap();
    let usage = wgpu::BufferUsages::INDIRECT;
    let arguments = filled_buffer(&gpu.device, "arguments", bytemuck::cast_slice(&arguments), usage);
    let chosen =
        ChosenRuns { runs: &runs, offset: 256, size: 16, arguments: &arguments, arguments_offset: 16 };
    let none = ChosenRuns { arguments_offset: 0, ..chosen };
    let by_ranges = [2..4, 6..7, 8..10];
    let map = |triangles: &[std::ops::Range<u32>], chosen| -> (Vec<u32>, Vec<u32>) {
        let [depth, ids] = depth_textures(&gpu, SIDE, 1);
        let (depth_view, ids_view) = (layer(&depth, 0), layer(&ids, 0));
        let target = DepthTarget {
            ids: Some(&ids_view),
            triangles: Some(triangles),
            chosen,
            ..DepthTarget::new(&depth_view, projections(Vec3::ZERO)[0])
        };
        let mut encoder = gpu.encoder();
        let mut recorder = Recorder::new(&gpu.device, &gpu.queue, &mut encoder);
        let mut pass = DepthPass::new(&gpu.device, DepthIds::Triangle, None);
        pass.record(&mut recorder, "prepare.depth", &buffers.view(None), &[target]);
        gpu.submit(encoder).unwrap();
        (gpu.read_texture(&depth, 0).unwrap(), gpu.read_texture(&ids, 0).unwrap())
    };
    let both = map(&by_ranges[..1], Some(chosen));
    assert!(both == map(&by_ranges, None));
    assert!(map(&[], Some(chosen)) == map(&by_ranges[1..], None));
    assert!(map(&by_ranges[..1], Some(none)) == map(&by_ranges[..1], None));
    let seen = |triangle: u32| both.1.iter().filter(|&&id| id == triangle).count();
    let [of_first, of_second] = [seen(6), seen(8) + seen(9)];
    assert!(of_first > 10 && of_second > 10, "{of_first}, {of_second}");
    assert_eq!([0, 7].map(seen), [0, 0]);
}

#[test]
fn triangle_ranges_and_viewports_limit_what_is_drawn() {
    let Some(gpu) = testing::gpu() else { return };
    let scene = scene(Vec3::ZERO);
    let buffers = SceneBuffers::new(&gpu.device, &scene).unwrap();
    let [depth, _] = depth_textures(&gpu, 2 * SIDE, 1);
    let view = layer(&depth, 0);
    let clip = projections(Vec3::ZERO)[0];
    // Holes and pyramid without the floor, in the lower right quarter; then the whole in the upper left.
    let ranges = [2..4, 6..1000];
    let mut encoder = gpu.encoder();
    let mut pass = DepthPass::new(&gpu.device, DepthIds::None, None);
    let part = DepthTarget {
        viewport: Some([SIDE, SIDE, SIDE, SIDE]),
        triangles: Some(&ranges),
        ..DepthTarget::new(&view, clip)
    };
    let whole = DepthTarget {
        viewport: Some([0, 0, SIDE, SIDE]),
        triangles: None,
        clear: false,
        ..DepthTarget::new(&view, clip)
    };
    let mut recorder = Recorder::new(&gpu.device, &gpu.queue, &mut encoder);
    pass.record(&mut recorder, "prepare.depth", &buffers.view(None), &[part, whole]);
    gpu.submit(encoder).unwrap();
    let texels: Vec<f32> = gpu.read_texture(&depth, 0).unwrap();
    let quarter = |x0: u32, y0: u32| -> Vec<f32> {
        let rows = (0..SIDE).map(|y| ((y0 + y) * 2 * SIDE + x0) as usize);
        rows.flat_map(|start| texels[start..start + SIDE as usize].to_vec()).collect()
    };
    let in_part = check_map(&scene, clip, &quarter(SIDE, SIDE), None, |object| object == 2 || object == 4);
    let in_whole = check_map(&scene, clip, &quarter(0, 0), None, |object| object != 3);
    assert!(in_part > 100 && in_part < in_whole, "{in_part} {in_whole}");
    assert!(quarter(SIDE, 0).iter().chain(&quarter(0, SIDE)).all(|&depth| depth == 0.0));
}

#[test]
fn stages_are_timed_by_name() {
    let Some(gpu) = testing::gpu() else { return };
    let scene = scene(Vec3::ZERO);
    let buffers = SceneBuffers::new(&gpu.device, &scene).unwrap();
    let camera = camera(Vec3::ZERO, 50.0);
    let targets = GBufferTargets::new(&gpu.device, 512, 512);
    let on_the_device = StageTimer::new(&gpu.device, &gpu.queue, 8);
    assert_eq!(on_the_device.is_some(), gpu.has_timestamps());
    let mut pass = GBufferPass::new(&gpu.device);
    let timers = on_the_device.into_iter().chain([StageTimer::on_the_wall()]);
    for mut timer in timers {
        for _frame in 0..2 {
            let start = Instant::now();
            let mut encoder = gpu.encoder();
            let mut recorder = Recorder::new(&gpu.device, &gpu.queue, &mut encoder);
            recorder.timer = Some(&mut timer);
            for stage in ["shade.first", "shade.second", "shade.first"] {
                pass.record(&mut recorder, stage, &buffers.view(None), &camera, &targets);
            }
            timer.resolve(&mut encoder);
            gpu.submit(encoder).unwrap();
            let report = gpu.read_times(&mut timer).unwrap();
            assert_eq!(report.stages_ms.keys().collect::<Vec<_>>(), ["shade.first", "shade.second"]);
            let (stages_ms, wall_ms) = (report.total_ms("shade."), start.elapsed().as_secs_f64() * 1e3);
            match timer.buffer() {
                Some(_) => assert!((0.0..60_000.0).contains(&stages_ms), "{report:?}"),
                None => assert!(0.0 < stages_ms && stages_ms <= wall_ms, "{report:?} of {wall_ms}"),
            }
        }
    }
}

#[test]
fn reading_with_the_wrong_type_is_refused() {
    let Some(gpu) = testing::gpu() else { return };
    let targets = GBufferTargets::new(&gpu.device, 4, 4);
    assert!(gpu.read_texture::<u8>(&targets.surface, 0).is_err());
    assert_eq!(gpu.read_texture::<f32>(&targets.depth, 0).unwrap().len(), 16);
}

/// The same surfaces as the CPU rasteriser sees, but for pixels whose centre lies within a snapping step of an
/// outline; there both take one of the two surfaces that meet. Depths and normals agree within the rounding of
/// the GPU's f32 arithmetic; the CPU's is f64.
#[test]
fn the_gbuffer_is_the_cpu_rasterisers() {
    let Some(gpu) = testing::gpu() else { return };
    for offset in [Vec3::ZERO, Vec3::new(3000.0, -500.0, 8000.0)] {
        let (scene, camera) = (scene(offset), camera(offset, f32::INFINITY));
        let (on_gpu, on_cpu) = (draw_gbuffer(&gpu, &scene, &camera), render_gbuffer(&scene, &camera));
        let mut differ = 0;
        for pixel in 0..on_cpu.pixel_count() {
            if on_gpu.triangle[pixel] != on_cpu.triangle[pixel] {
                differ += 1;
                continue;
            }
            if !on_cpu.is_seen(pixel) {
                continue;
            }
            assert_eq!(on_gpu.object[pixel], on_cpu.object[pixel]);
            let normal = on_cpu.normal[pixel];
            assert!((on_gpu.normal[pixel] - normal).length() <= 16.0 * f32::EPSILON);
            let to_eye = camera.eye - on_cpu.position[pixel];
            // Beside the distance itself, that of the nearest corner takes part.
            let reach = 2.0 * to_eye.length() + 10.0;
            let bound = 32.0 * f32::EPSILON * reach / normal.dot(to_eye.normalize()).max(1e-6);
            let error = (on_gpu.depth[pixel] - on_cpu.depth[pixel]).abs();
            assert!(error <= bound, "pixel {pixel}: depth off by {error}, bound {bound}");
        }
        // Outlines of 14 triangles and 16 texels of a mask cross a few hundred pixels; a sixteenth of those may differ,
        // and far less do.
        assert!(differ * 200 <= on_cpu.pixel_count(), "{differ} pixels differ");
    }
}
