//! Penumbrae that are known in closed form: widths at several receiver depths, inner and outer; the umbra of a box.

use glam::{Affine3A, Vec3};
use gnomon_ddoc::{Ddoc, DdocParams};
use scene_core::bvh::Bvh;
use scene_core::geometry::ObjectFlags;
use scene_core::reference::{self, ReferenceSettings, no_progress};
use scene_core::{Light, Scene, TriangleMesh, VisibilityImage, raster, scenes};

fn square(center: Vec3, half: f32) -> TriangleMesh {
    let corner = |x: f32, z: f32| center + Vec3::new(x * half, 0.0, z * half);
    let positions = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    TriangleMesh::new("square", positions, vec![[0, 1, 2], [0, 2, 3]])
}

fn cube(center: Vec3, half: f32) -> TriangleMesh {
    let corner = |i: u32| {
        let sign = |bit: u32| if i >> bit & 1 == 1 { half } else { -half };
        center + Vec3::new(sign(0), sign(1), sign(2))
    };
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
    TriangleMesh::new("box", (0..8).map(corner).collect(), triangles)
}

const LIGHT_HEIGHT: f32 = 4.0;
const HALF: f32 = 0.5;
const TAPS: u32 = 256;

fn lights() -> [Light; 2] {
    let center = Vec3::Y * LIGHT_HEIGHT;
    [
        Light::Rect { center, half_u: Vec3::X * HALF, half_v: Vec3::Z * 0.3 },
        Light::Disk { center, normal: Vec3::NEG_Y, radius: HALF },
    ]
}

/// Share of a light of half width 1 that lies right of `at`.
fn right_of(light: &Light, at: f32) -> f32 {
    let at = at.clamp(-1.0, 1.0);
    match light {
        Light::Disk { .. } => (at.acos() - at * (1.0 - at * at).sqrt()) / std::f32::consts::PI,
        _ => 0.5 * (1.0 - at),
    }
}

/// V along x on a receiver at the height −`depth`, at z = 0.
fn profile(scene: &Scene, light: &Light, depth: f32, xs: &[f32]) -> Vec<f32> {
    let params = DdocParams { taps: TAPS, ..Default::default() };
    let (prepared, _) = Ddoc::new(params).prepare(scene, light).expect("few triangles");
    let points: Vec<Vec3> = xs.iter().map(|&x| Vec3::new(x, -depth, 0.013)).collect();
    let mut values = vec![0.0; xs.len()];
    prepared.visibility_at(&points, &mut values);
    values
}

/// The first and last x with V strictly between 0 and 1.
fn penumbra(xs: &[f32], values: &[f32]) -> [f32; 2] {
    let partly = |v: &f32| *v > 0.0 && *v < 1.0;
    let first = values.iter().position(partly).expect("a penumbra");
    let last = values.iter().rposition(partly).expect("a penumbra");
    [xs[first], xs[last]]
}

/// A half-plane at height 1 (and the face of a box there) that ends at x = 0, receivers at heights 0, −1 and −2. The line
/// from (x, −d) through the edge meets the light's plane at −x·(4 − 1)/(1 + d): the penumbra reaches to
/// ±½·(1 + d)/3 on both sides of the hard shadow's edge, x = 0.
///
/// Bounds: V has steps of 1/256, and 256 points of a (0, 2)-sequence leave strips of 1/256 of a rect's width at each side
/// empty, of a disk's the caps of that area, (3π/(8·√2·256))^(2/3) = 0.022 of the radius: less than 2 texels of the map.
/// V itself: a (0, 2)-sequence cut by a line along an axis is off by 1/256, on a disk by √256 cells of one point each at
/// most; half of them in the mean.
#[test]
fn widths_are_right_at_every_depth_inside_and_outside() {
    for light in lights() {
        for (name, caster) in [
            ("half-plane", square(Vec3::new(-8.0, 1.0, 0.0), 8.0)),
            ("box", cube(Vec3::new(-1.0, 0.0, 0.0), 1.0)),
        ] {
            let mut scene = Scene::new();
            for mesh in [square(Vec3::Y * -9.0, 20.0), caster] {
                scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).expect("a sound mesh");
            }
            // A box's lower edge bounds the shadow on the side of the light's points left of x = 0.
            for depth in [1.5f32, 2.0, 3.0] {
                let reach = HALF * (1.0 + depth) / (LIGHT_HEIGHT - 1.0);
                let lower = HALF * (depth - 1.0) / (LIGHT_HEIGHT + 1.0);
                let inner = reach;
                let outer = if name == "box" { lower.max(reach) } else { reach };
                let xs: Vec<f32> = (0..=4000).map(|i| (i as f32 / 2000.0 - 1.0) * 2.0 * reach).collect();
                let values = profile(&scene, &light, depth, &xs);
                let [first, last] = penumbra(&xs, &values);
                // The map's window is the caster's, 16 or 2 wide, seen at the receiver's distance.
                let window = if name == "box" { 2.0 * LIGHT_HEIGHT / 3.0 } else { 16.0 };
                let texel = window / 1024.0 * (LIGHT_HEIGHT + depth) / (LIGHT_HEIGHT - 1.0);
                let step = 4.0 * reach / 4000.0;
                let blind = if matches!(light, Light::Disk { .. }) { 0.022 } else { 2.0 / 256.0 };
                let bound = (2.0 * texel).max(blind * reach + 2.0 * step);
                assert!(
                    (last - outer).abs() <= bound,
                    "{name} {light:?} at {depth}: outer {last} for {outer}"
                );
                if name == "half-plane" {
                    assert!((first + inner).abs() <= bound, "{name} {light:?} at {depth}: inner {first}");
                    for (x, v) in xs.iter().zip(&values) {
                        let expected = right_of(&light, -x / reach);
                        assert!(
                            (v - expected).abs() <= 8.5 / 256.0,
                            "{light:?} at {depth}, {x}: {v} for {expected}"
                        );
                    }
                }
            }
        }
    }
}

/// Pixels in the umbra of a box as the light grows, against ray tracing: within 5 %.
#[test]
fn the_umbra_shrinks_with_the_light_as_it_does_in_truth() {
    let mut scene = Scene::new();
    for mesh in [square(Vec3::ZERO, 4.0), cube(Vec3::Y * 1.2, 0.5)] {
        scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).expect("a sound mesh");
    }
    let mut camera = scenes::build("quads", 0.0).expect("built in").camera;
    (camera.width, camera.height) = (256, 192);
    let gbuffer = raster::render_gbuffer(&scene, &camera);
    let mut last = usize::MAX;
    for half in [0.1f32, 0.3, 0.5, 0.7] {
        let center = Vec3::Y * 5.0;
        for light in [
            Light::Rect { center, half_u: Vec3::X * half, half_v: Vec3::Z * half },
            Light::Disk { center, normal: Vec3::NEG_Y, radius: half },
        ] {
            let sampling = ReferenceSettings { samples: 256, ..Default::default() };
            let casters = Bvh::casters(&scene);
            let truth = reference::reference(&scene, &casters, &light, &gbuffer, &sampling, &no_progress)
                .expect("nobody cancels");
            let (prepared, _) = Ddoc::new(DdocParams { taps: 256, ..Default::default() })
                .prepare(&scene, &light)
                .expect("few");
            let mut image = VisibilityImage::new(camera.width, camera.height);
            prepared.shade(&gbuffer, &mut image);
            let umbra = |values: &[f32]| {
                let on_ground = (0..values.len()).filter(|&pixel| gbuffer.object[pixel] == 0);
                on_ground.filter(|&pixel| values[pixel] < 0.004).count()
            };
            let (ours, expected) = (umbra(&image.values), umbra(&truth.visibility.values));
            let allowed = (expected as f32 * 0.05) as usize;
            assert!(ours.abs_diff(expected) <= allowed, "{light:?}: {ours} pixels for {expected}");
            if matches!(light, Light::Rect { .. }) {
                assert!(ours < last && ours > 100, "{light:?}: {ours} after {last}");
                last = ours;
            }
        }
    }
}
