//! Depth maps: the bound they promise, conventions, filters, masks, threads.

#![expect(clippy::single_range_in_vec_init, reason = "a list of one range of triangles is what is meant")]

use std::sync::Arc;

use glam::camera::rh::proj::directx::{perspective, perspective_infinite_reverse};
use glam::{Affine3A, Mat4, Vec2, Vec3};
use gnomon_scene_core::geometry::{AlphaMask, ObjectFlags, Wrap};
use gnomon_scene_core::raster::{
    Cull, DepthConvention, DepthMap, DepthOptions, DepthRange, RasterScratch, depth_error, render_depth,
    render_depth_and_objects_into, render_depth_and_triangles_into, render_depth_into,
};
use gnomon_scene_core::{GBuffer, Scene, TriangleMesh};
use proptest::prelude::*;

use super::caster::depths_at;
use super::meshes::{add, blob, camera, flat, hash, pixel_space, scene_of};

const SIZE: u32 = 48;

/// A random soup of triangles before the camera, from slivers to screen-filling ones.
fn soup(seed: u64, count: u64) -> Scene {
    let mut positions = Vec::new();
    for triangle in 0..count {
        let random = |i: u64| hash(seed.wrapping_mul(977) ^ (triangle << 8) ^ i) * 2.0 - 1.0;
        let center = Vec3::new(random(0), random(1), random(2)) * 0.8;
        let size = [0.02, 0.1, 0.5, 1.2][triangle as usize % 4];
        for corner in 0..3 {
            let offset = Vec3::new(random(10 + corner), random(20 + corner), random(30 + corner));
            positions.push(center + offset * size);
        }
    }
    let triangles = (0..count as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    scene_of(positions, triangles)
}

/// The largest change of depth a pixel, along x plus along y, of any triangle of the scene.
fn steepest(scene: &Scene, clip_from_world: Mat4) -> impl Fn(usize) -> f64 {
    let slopes: Vec<f64> = (0..scene.triangles().len())
        .map(|triangle| {
            let [a, b, c] = scene.corners(triangle).map(|p| {
                let clip = clip_from_world.as_dmat4() * glam::DVec4::from((p.as_dvec3(), 1.0));
                let ndc = clip / clip.w;
                let half = f64::from(SIZE) * 0.5;
                glam::DVec3::new((ndc.x + 1.0) * half, (1.0 - ndc.y) * half, ndc.z)
            });
            let normal = (b - a).cross(c - a);
            (normal.x.abs() + normal.y.abs()) / normal.z.abs()
        })
        .collect();
    move |triangle| slopes[triangle]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    /// Away from edges a stored depth is the ray caster's, within the documented bound, for both conventions.
    #[test]
    fn depth_equals_ray_casting_within_its_bound(seed in any::<u64>(), reversed in any::<bool>()) {
        let scene = soup(seed, 24);
        let view = camera(SIZE, SIZE).view_from_world();
        let (projection, convention) = if reversed {
            (perspective_infinite_reverse(0.8, 1.0, 0.1), DepthConvention::Reversed)
        } else {
            (perspective(0.8, 1.0, 0.1, 20.0), DepthConvention::Forward)
        };
        let matrix = projection * view;
        let options = DepthOptions { convention, ..Default::default() };
        let map = render_depth(&scene, matrix, SIZE, SIZE, &options);
        let slope = steepest(&scene, matrix);
        // The nearest may be any triangle over the pixel: the bound is that of the steepest.
        let steepest = (0..scene.triangles().len()).map(slope).fold(0.0, f64::max) as f32;
        let mut compared = 0;
        for y in 0..SIZE {
            for x in 0..SIZE {
                let Some(depths) = depths_at(&scene, &matrix.as_dmat4(), [SIZE; 2], [x, y], 0.005) else { continue };
                let nearest = depths.into_iter().reduce(if reversed { f64::max } else { f64::min });
                let expected = nearest.unwrap_or(f64::from(convention.clear_value())) as f32;
                let found = map.depth[(y * SIZE + x) as usize];
                prop_assert!((found - expected).abs() <= depth_error(steepest, 1.0), "{found} for {expected}");
                compared += 1;
            }
        }
        prop_assert!(compared > SIZE * SIZE / 2);
    }

    /// One triangle at a time the bound is that of its own slope.
    #[test]
    fn one_triangle_keeps_its_own_bound(seed in any::<u64>()) {
        let scene = soup(seed, 4);
        let matrix = perspective_infinite_reverse(0.8, 1.0, 0.1) * camera(SIZE, SIZE).view_from_world();
        let slope = steepest(&scene, matrix);
        for triangle in 0..4 {
            let ranges = [triangle..triangle + 1];
            let options = DepthOptions { triangles: Some(&ranges), ..Default::default() };
            let map = render_depth(&scene, matrix, SIZE, SIZE, &options);
            let alone = scene_of(scene.corners(triangle).to_vec(), vec![[0, 1, 2]]);
            for y in 0..SIZE {
                for x in 0..SIZE {
                    let Some(depths) = depths_at(&alone, &matrix.as_dmat4(), [SIZE; 2], [x, y], 0.005) else { continue };
                    let expected = depths.first().copied().unwrap_or(0.0) as f32;
                    let found = map.depth[(y * SIZE + x) as usize];
                    let bound = depth_error(slope(triangle) as f32, 1.0);
                    prop_assert!((found - expected).abs() <= bound, "{found} for {expected} ± {bound}");
                }
            }
        }
    }
}

/// A square in pixel space at depth `z`.
fn square(min: f32, max: f32, z: f32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let corner = |x, y| flat(Vec2::new(x, y), z);
    (vec![corner(min, min), corner(max, min), corner(max, max), corner(min, max)], vec![[0, 1, 2], [0, 2, 3]])
}

fn squares(squares: &[(f32, f32, f32)]) -> Scene {
    let mut scene = Scene::new();
    for &(min, max, z) in squares {
        let (positions, triangles) = square(min, max, z);
        add(&mut scene, positions, triangles);
    }
    scene
}

fn centre(map: &DepthMap) -> f32 {
    map.depth[((map.height / 2) * map.width + map.width / 2) as usize]
}

#[test]
fn the_nearest_wins_in_both_conventions() {
    let scene = squares(&[(0.0, 48.0, 0.25), (0.0, 48.0, 0.75), (0.0, 24.0, 0.5)]);
    let draw = |convention| {
        let options = DepthOptions { convention, ..Default::default() };
        render_depth(&scene, pixel_space(SIZE), SIZE, SIZE, &options)
    };
    assert!(draw(DepthConvention::Reversed).depth.iter().all(|&d| d == 0.75));
    assert!(draw(DepthConvention::Forward).depth.iter().all(|&d| d == 0.25));
}

#[test]
fn depths_out_of_range_are_rejected_or_clamped() {
    let scene = squares(&[(0.0, 48.0, 1.5), (0.0, 48.0, -0.5)]);
    for (convention, near, far) in
        [(DepthConvention::Reversed, 1.0, 0.0), (DepthConvention::Forward, 0.0, 1.0)]
    {
        let draw = |range, triangles: &[std::ops::Range<usize>]| {
            let options =
                DepthOptions { convention, range, triangles: Some(triangles), ..Default::default() };
            centre(&render_depth(&scene, pixel_space(SIZE), SIZE, SIZE, &options))
        };
        assert_eq!(draw(DepthRange::Clip, &[0..4]), convention.clear_value());
        let (before, beyond) = if near == 1.0 { (0..2, 2..4) } else { (2..4, 0..2) };
        assert_eq!(draw(DepthRange::Clamp, &[before]), near);
        assert_eq!(draw(DepthRange::Clamp, &[beyond]), far);
    }
}

/// A slope through the near plane is cut pixel by pixel where it passes it.
#[test]
fn a_slope_is_cut_at_the_near_plane() {
    let positions = vec![
        Vec3::new(0.0, 0.0, 0.0),
        Vec3::new(48.0, 0.0, 2.0),
        Vec3::new(48.0, 48.0, 2.0),
        Vec3::new(0.0, 48.0, 0.0),
    ];
    let scene = scene_of(positions, vec![[0, 1, 2], [0, 2, 3]]);
    for (range, beyond) in [(DepthRange::Clip, 0.0), (DepthRange::Clamp, 1.0)] {
        let options = DepthOptions { range, ..Default::default() };
        let map = render_depth(&scene, pixel_space(SIZE), SIZE, SIZE, &options);
        for (pixel, &found) in map.depth.iter().enumerate() {
            let depth = ((pixel as u32 % SIZE) as f32 + 0.5) / 24.0;
            let expected = if depth <= 1.0 { depth } else { beyond };
            assert!((found - expected).abs() < 1e-6, "{found} for {expected}");
        }
    }
}

#[test]
fn culling_leaves_out_one_side() {
    // Clockwise as seen in pixel space: a back face.
    let scene = squares(&[(0.0, 48.0, 0.5)]);
    let draw = |cull| {
        let options = DepthOptions { cull, ..Default::default() };
        centre(&render_depth(&scene, pixel_space(SIZE), SIZE, SIZE, &options))
    };
    assert_eq!([Cull::None, Cull::Front, Cull::Back].map(draw), [0.5, 0.5, 0.0]);
    let (positions, triangles) = blob(90, 70, |_, _| 1.0);
    let ball = scene_of(positions, triangles);
    let matrix = camera(SIZE, SIZE).projection_from_world();
    let draw = |cull| render_depth(&ball, matrix, SIZE, SIZE, &DepthOptions { cull, ..Default::default() });
    assert_eq!(draw(Cull::None), draw(Cull::Back), "the fronts of a ball hide its backs");
    assert!(centre(&draw(Cull::Front)) < centre(&draw(Cull::None)));
}

#[test]
fn only_casters_and_chosen_triangles_are_drawn() {
    let mut scene = squares(&[(0.0, 48.0, 0.25), (0.0, 48.0, 0.5)]);
    let (positions, triangles) = square(0.0, 48.0, 0.75);
    let mesh = TriangleMesh::new("ghost", positions, triangles);
    scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags { casts: false, ..Default::default() }).unwrap();
    let draw = |triangles: Option<&[std::ops::Range<usize>]>| {
        let options = DepthOptions { triangles, ..Default::default() };
        centre(&render_depth(&scene, pixel_space(SIZE), SIZE, SIZE, &options))
    };
    assert_eq!(draw(None), 0.5);
    assert_eq!(draw(Some(&[0..2])), 0.25);
    assert_eq!(draw(Some(&[4..6])), 0.0);
    assert_eq!(draw(Some(&[])), 0.0);
    assert_eq!(draw(Some(&[4..usize::MAX, 0..3])), 0.5);
    #[expect(clippy::reversed_empty_ranges, reason = "a range the wrong way round is empty")]
    let backwards = draw(Some(&[3..1, 100..200]));
    assert_eq!(backwards, 0.0);
}

#[test]
fn objects_are_those_of_the_nearest_surface() {
    let scene = squares(&[(0.0, 20.0, 0.25), (10.0, 40.0, 0.5), (10.0, 40.0, 0.5)]);
    let mut map = DepthMap { width: SIZE, height: SIZE, depth: Vec::new() };
    let mut objects = Vec::new();
    let (options, mut scratch) = (DepthOptions::default(), RasterScratch::new());
    render_depth_and_objects_into(&scene, pixel_space(SIZE), &options, &mut scratch, &mut map, &mut objects);
    let at = |x: u32, y: u32| objects[(y * SIZE + x) as usize];
    assert_eq!([at(5, 5), at(15, 15), at(30, 30), at(45, 45)], [0, 1, 1, GBuffer::NOTHING]);
    assert_eq!(map, render_depth(&scene, pixel_space(SIZE), SIZE, SIZE, &options));
}

/// Inside of a window all is as without, of triangles of every size and of few of them.
#[test]
fn a_window_is_a_part_of_the_whole() {
    let (width, height) = (300, 200);
    let matrix = camera(width, height).projection_from_world();
    let scene = soup(3, 4000);
    let draw = |triangles: &[std::ops::Range<usize>], window: Option<&[std::ops::Range<u32>; 2]>| {
        let options = DepthOptions { triangles: Some(triangles), window, ..Default::default() };
        let (mut map, mut ids) = (DepthMap { width, height, depth: Vec::new() }, Vec::new());
        let mut scratch = RasterScratch::new();
        render_depth_and_triangles_into(&scene, matrix, &options, &mut scratch, &mut map, &mut ids);
        (map, ids)
    };
    for triangles in [vec![0..4000], vec![100..180, 171..400, 3000..3001]] {
        let (whole, whole_ids) = draw(&triangles, None);
        for window in
            [[0..300, 0..200], [17..50, 70..71], [250..300, 31..97], [9..9, 5..70], [280..900, 180..900]]
        {
            let (part, ids) = draw(&triangles, Some(&window));
            let mut seen = 0;
            for row in window[1].start..window[1].end.min(height) {
                for column in window[0].start..window[0].end.min(width) {
                    let pixel = (row * width + column) as usize;
                    assert_eq!(part.depth[pixel].to_bits(), whole.depth[pixel].to_bits(), "{column}, {row}");
                    assert!(part.depth[pixel] == 0.0 || ids[pixel] == whole_ids[pixel]);
                    seen += usize::from(part.depth[pixel] > 0.0);
                }
            }
            assert!(seen > 0 || window[0].is_empty());
            let drawn = |map: &DepthMap| map.depth.iter().filter(|&&depth| depth > 0.0).count();
            assert!(drawn(&part) < drawn(&whole) || window[1] == (0..height), "{window:?} draws all");
        }
    }
}

/// A used scratch and target leave nothing behind.
#[test]
fn memory_of_another_frame_does_not_show() {
    let (mut scratch, options) = (RasterScratch::new(), DepthOptions::default());
    let mut map = DepthMap { width: 300, height: 200, depth: Vec::new() };
    let matrix = camera(300, 200).projection_from_world();
    render_depth_into(&soup(1, 3000), matrix, &options, &mut scratch, &mut map);
    let scene = soup(2, 100);
    for (width, height) in [(48, 48), (700, 33), (1, 1), (0, 5), (5, 0)] {
        (map.width, map.height) = (width, height);
        render_depth_into(&scene, matrix, &options, &mut scratch, &mut map);
        assert_eq!(map, render_depth(&scene, matrix, width, height, &options));
        assert_eq!(map.depth.len(), (width * height) as usize);
    }
}

#[test]
fn threads_do_not_change_a_bit() {
    let mut scene = soup(3, 20_000);
    let (positions, triangles) =
        blob(200, 150, |slice, stack| 1.0 - 0.2 * hash(u64::from(slice * 1000 + stack)));
    add(&mut scene, positions, triangles);
    let matrix = camera(300, 200).projection_from_world();
    let options = DepthOptions::default();
    let draw = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut map = DepthMap { width: 300, height: 200, depth: Vec::new() };
            let mut objects = Vec::new();
            let mut scratch = RasterScratch::new();
            render_depth_and_objects_into(&scene, matrix, &options, &mut scratch, &mut map, &mut objects);
            (map.depth.iter().map(|d| d.to_bits()).collect::<Vec<_>>(), objects)
        })
    };
    let one = draw(1);
    for threads in [2, 3, 8] {
        assert!(draw(threads) == one, "{threads} threads");
    }
}

/// A floor in perspective with a checkered mask: a pixel is covered where the texel under its centre is solid.
#[test]
fn a_mask_cuts_at_the_perspective_correct_texel() {
    let alpha: Vec<u8> = (0..64).map(|i| if (i / 8 + i % 8) % 2 == 0 { 255 } else { 0 }).collect();
    let mask = Arc::new(AlphaMask::from_alpha(8, 8, &alpha, 0.5, [Wrap::Repeat; 2]).unwrap());
    let corner = |x: f32, z: f32| Vec3::new(x, -1.0, z);
    let mut mesh = TriangleMesh::new(
        "floor",
        vec![corner(-4.0, -9.0), corner(4.0, -9.0), corner(4.0, 3.0), corner(-4.0, 3.0)],
        vec![[0, 1, 2], [0, 2, 3]],
    );
    mesh.uvs = mesh.positions.iter().map(|p| Vec2::new(p.x, p.z) * 0.25).collect();
    mesh.alpha = Some(mask.clone());
    let mut scene = Scene::new();
    scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).unwrap();
    let size = 128;
    let map = render_depth(
        &scene,
        perspective_infinite_reverse(1.2, 1.0, 0.1),
        size,
        size,
        &DepthOptions::default(),
    );
    let tan = (0.6_f32).tan();
    let (mut solid, mut open, mut wrong) = (0, 0, 0);
    for y in size / 2..size {
        for x in 0..size {
            let ray = Vec2::new(x as f32 + 0.5, y as f32 + 0.5) / size as f32 * 2.0 - 1.0;
            let distance = 1.0 / (ray.y * tan);
            let point = Vec2::new(ray.x * tan * distance, -distance);
            if point.x.abs() > 3.9 || distance > 8.9 {
                continue;
            }
            // Within a thousandth of a texel rounding may decide.
            let texel = point * 2.0;
            if (texel - texel.round()).abs().min_element() < 1e-3 {
                continue;
            }
            let expected = mask.is_solid(point * 0.25);
            if expected {
                solid += 1;
            } else {
                open += 1;
            }
            wrong += u32::from((map.depth[(y * size + x) as usize] > 0.0) != expected);
        }
    }
    assert!(solid > 1000 && open > 1000, "{solid} {open}");
    assert_eq!(wrong, 0);
}
