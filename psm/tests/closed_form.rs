//! d and shadows that are known in closed form.

use glam::{Affine3A, DVec3, Vec3};
use gnomon_psm::view_frame::ViewFrame;
use gnomon_psm::{Lookup, Psm, PsmParams, Variant};
use scene_core::geometry::ObjectFlags;
use scene_core::{Camera, GBuffer, Light, Scene, TriangleMesh, VisibilityImage, raster};

const SIZE: u32 = 512;

/// A rectangle at height `y`.
fn rectangle(y: f32, x: [f32; 2], z: [f32; 2]) -> TriangleMesh {
    let positions =
        [(x[0], z[0]), (x[1], z[0]), (x[1], z[1]), (x[0], z[1])].map(|(x, z)| Vec3::new(x, y, z)).to_vec();
    TriangleMesh::new("rectangle", positions, vec![[0, 1, 2], [0, 2, 3]])
}

/// A plain at height 0 with a few blocks' lids over it.
fn plain() -> Scene {
    let mut scene = Scene::new();
    for mesh in [
        rectangle(0.0, [-6.0, 6.0], [-34.0, 10.0]),
        rectangle(0.6, [-0.6, 0.2], [-4.0, -3.0]),
        rectangle(0.4, [-1.0, 3.0], [-30.0, -20.0]),
        rectangle(0.5, [0.3, 0.5], [-2.5, -2.0]),
    ] {
        scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).expect("a sound mesh");
    }
    scene
}

fn camera(eye: Vec3, target: Vec3) -> Camera {
    Camera { eye, target, up: Vec3::Y, fov_y: 0.9, near: 0.01, far: f32::INFINITY, width: 200, height: 160 }
}

fn sun(direction: Vec3) -> Light {
    Light::Directional { direction, angular_radius: 0.0 }
}

/// d along the map's x and y at ground points that `camera` sees.
fn sides_on_the_ground(variant: Variant, camera: &Camera, light: &Light) -> Vec<(DVec3, f64)> {
    let scene = plain();
    let gbuffer = raster::render_gbuffer(&scene, camera);
    let technique = Psm::new(PsmParams { variant, map_size: SIZE, ..Default::default() });
    let (prepared, _) = technique.prepare(&scene, light, camera, &gbuffer);
    let [map] = prepared.maps() else { panic!("one map, not {}", prepared.maps().len()) };
    let frame = ViewFrame::new(camera);
    let ground = (0..gbuffer.pixel_count()).filter(|&i| gbuffer.is_seen(i) && gbuffer.object[i] == 0);
    let points = ground.map(|i| gbuffer.position[i].as_dvec3());
    points.map(|p| (p, map.view.texel_in_pixels(SIZE, &frame, p, DVec3::Y))).collect()
}

/// Figure 3: light from above, the camera level. Every texel on the ground has the same size in the image.
#[test]
fn d_is_constant_in_the_ideal_case() {
    let camera = camera(Vec3::new(0.0, 1.0, 0.0), Vec3::new(0.0, 1.0, -1.0));
    let spread = |variant| {
        let d: Vec<f64> =
            sides_on_the_ground(variant, &camera, &sun(Vec3::NEG_Y)).iter().map(|s| s.1).collect();
        assert!(d.len() > 5000);
        d.iter().copied().fold(0.0, f64::max) / d.iter().copied().fold(f64::INFINITY, f64::min)
    };
    let psm = spread(Variant::Psm);
    assert!(psm < 1.01, "{psm}");
    // The same view has more than a factor of ten in a uniform map.
    assert!(spread(Variant::Uniform) > 10.0);
}

/// The paper's `d = d_s (r_s/r_i)(cos β/cos α)`, for a camera above the ground that looks straight down, whose pixels are
/// as large on the ground as anywhere: β = α = 0 under parallel light from above, and `r_s` drops out. d is then the
/// texel's width over the pixel's.
#[test]
fn d_on_a_plane_is_the_texels_width_over_the_pixels() {
    let mut camera = camera(Vec3::new(0.0, 5.0, -10.0), Vec3::new(0.0, 0.0, -10.0));
    camera.up = Vec3::NEG_Z;
    // What a pixel spans at the distance 5, and the map's texels over the picture's width and height.
    let height = 2.0 * 5.0 * (0.45f64).tan();
    let width = height * 200.0 / 160.0;
    // The window goes from the first pixel's centre to the last one's.
    let span = [width * 199.0 / 200.0, height * 159.0 / 160.0];
    let pixel = height / 160.0;
    let expected = (span[0] + span[1]) * 0.5 / f64::from(SIZE) / pixel;
    for variant in Variant::ALL {
        for (point, d) in sides_on_the_ground(variant, &camera, &sun(Vec3::NEG_Y)) {
            assert!((d / expected - 1.0).abs() < 0.01, "{variant:?} at {point}: {d}, not {expected}");
        }
    }
}

/// The same seen at a slant: along the view `r_i` grows and the ground tilts to the camera. Along the level direction d
/// is `d_s` over a pixel at `r_i`, across it that times cos β/cos α with β the light's and α the camera's angle to the normal
/// exchanged for what one pixel spans: `d_s · h/z²` for a camera of height h that looks level at depth z.
#[test]
fn d_of_a_uniform_map_falls_with_the_square_of_the_distance() {
    let camera = camera(Vec3::new(0.0, 1.0, 0.0), Vec3::new(0.0, 1.0, -1.0));
    let scene = plain();
    let gbuffer = raster::render_gbuffer(&scene, &camera);
    let light = sun(Vec3::NEG_Y);
    let technique = Psm::new(PsmParams { variant: Variant::Uniform, map_size: SIZE, ..Default::default() });
    let (prepared, _) = technique.prepare(&scene, &light, &camera, &gbuffer);
    let frame = ViewFrame::new(&camera);
    let view = prepared.maps()[0].view;
    // A texel on the ground, from the map's forms: w is constant.
    let texel =
        [view.ndc.x, view.ndc.y].map(|form| 2.0 / f64::from(SIZE) * view.ndc.w.w / form.truncate().length());
    for z in [2.5, 6.0, 15.0, 40.0] {
        let point = DVec3::new(0.3, 0.0, -z);
        let pixels = frame.pixels.x;
        // x of the map is level, y along the view; off the middle column a step along the view moves sideways, too.
        let along = pixels / (z * z) * (1.0f64 + 0.3 * 0.3).sqrt();
        let expected = 0.5 * (texel[0] * pixels / z + texel[1] * along);
        let d = view.texel_in_pixels(SIZE, &frame, point, DVec3::Y);
        assert!((d / expected - 1.0).abs() < 1e-4, "at {z}: {d}, not {expected}");
    }
}

/// Seen pixels of the plain whose V differs from the projection of the lids, by how many pixels they are off at most.
#[test]
fn shadows_of_lids_are_their_projections() {
    let scene = plain();
    let camera = camera(Vec3::new(0.2, 1.3, 0.0), Vec3::new(0.0, 0.4, -3.0));
    let lids = [
        ([-0.6, 0.2], [-4.0, -3.0], 0.6),
        ([-1.0, 3.0], [-30.0, -20.0], 0.4),
        ([0.3, 0.5], [-2.5, -2.0], 0.5),
    ];
    for direction in
        [Vec3::NEG_Y, Vec3::new(0.5, -1.0, 0.3), Vec3::new(0.2, -0.6, 1.0), Vec3::new(-0.2, -0.6, -1.0)]
    {
        for (variant, lookup) in
            Variant::ALL.into_iter().flat_map(|v| [Lookup::Texel, Lookup::Surface].map(|lookup| (v, lookup)))
        {
            let gbuffer = raster::render_gbuffer(&scene, &camera);
            let params = PsmParams { variant, lookup, map_size: SIZE, ..Default::default() };
            let (prepared, _) = Psm::new(params).prepare(&scene, &sun(direction), &camera, &gbuffer);
            let mut image = VisibilityImage::new(camera.width, camera.height);
            prepared.shade(&gbuffer, &mut image);
            let frame = ViewFrame::new(&camera);
            let view = prepared.maps()[0].view;
            let (mut inside, mut compared) = (0, 0);
            for pixel in (0..gbuffer.pixel_count()).filter(|&i| gbuffer.is_seen(i) && gbuffer.object[i] == 0)
            {
                let p = gbuffer.position[pixel];
                // How deep the point lies in the nearest shadow: negative outside.
                let depth = lids.iter().map(|(x, z, height)| {
                    let on_lid = p + direction * (height / direction.y);
                    (on_lid.x - x[0]).min(x[1] - on_lid.x).min((on_lid.z - z[0]).min(z[1] - on_lid.z))
                });
                let depth = depth.fold(f32::NEG_INFINITY, f32::max);
                // Half a texel on the ground, along either side, is d pixels of what a pixel spans at most.
                let (t, _) = view.ndc.across(
                    view.ndc.place(p.as_dvec3()) + glam::DVec2::splat(2.0 / f64::from(SIZE)),
                    p.as_dvec3(),
                    DVec3::Y,
                );
                let texel = t.length() as f32 * 2.0;
                // Nearer to its receiver than a surface rises within a texel (times two, as question 3 has it) a
                // caster may be lost where it is cut into triangles.
                let tan = direction.with_y(0.0).length() / -direction.y;
                let lost = 2.0 * texel * (1.0 + tan) > 0.4 * (1.0 + tan * tan).sqrt();
                let (edge, lost) = match lookup {
                    Lookup::Texel => (texel, lost),
                    // Whatever the texels, but for the rounding of positions: as `plane_tolerance` and `view_tolerance` have it.
                    Lookup::Surface => ((34.0 + gbuffer.depth[pixel]) / 524_288.0, false),
                };
                if depth.abs() > edge && !lost {
                    let expected = if depth > 0.0 { 0.0 } else { 1.0 };
                    assert_eq!(
                        image.values[pixel],
                        expected,
                        "{variant:?}, {lookup:?}, {direction}, at {p}: {depth} off the edge, texel {texel}, d {}",
                        view.texel_in_pixels(SIZE, &frame, p.as_dvec3(), DVec3::Y)
                    );
                    compared += 1;
                    inside += usize::from(depth > 0.0);
                }
            }
            assert!(inside > 50 && compared > 2000, "{variant:?}, {direction}: {inside} of {compared}");
        }
    }
}

/// The sweep that `gnomon-shadow-map` passes: a lit plane shadows nothing of itself, from any angle, at any size of
/// map and scale.
#[test]
fn no_acne_on_a_plane_at_any_angle_size_and_scale() {
    for scale in [1e-3, 1.0, 1e4] {
        let mut scene = Scene::new();
        for y in [0.0, -scale] {
            let half = [-4.0 * scale, 4.0 * scale];
            scene.add(&rectangle(y, half, half), Affine3A::IDENTITY, ObjectFlags::default()).expect("sound");
        }
        let camera = Camera {
            near: 0.01 * scale,
            ..camera(Vec3::new(1.0, 3.0, 5.0) * scale, Vec3::new(0.0, 0.0, 0.5) * scale)
        };
        let gbuffer = raster::render_gbuffer(&scene, &camera);
        for degrees in [0.0f32, 15.0, 45.0, 70.0, 85.0, 89.0, 89.9] {
            for turn in [0.0f32, 1.0, 2.5, 4.0] {
                let (tilt, (sin, cos)) = (degrees.to_radians(), turn.sin_cos());
                let direction = Vec3::new(tilt.sin() * cos, -tilt.cos(), tilt.sin() * sin);
                for variant in Variant::ALL {
                    for map_size in [64, 512] {
                        let params = PsmParams { variant, map_size, ..Default::default() };
                        let (prepared, _) =
                            Psm::new(params).prepare(&scene, &sun(direction), &camera, &gbuffer);
                        let dark = dark_on(&gbuffer, &prepared, 0);
                        assert_eq!(
                            dark, 0,
                            "{variant:?}, {degrees}°, turn {turn}, map {map_size}, scale {scale}"
                        );
                    }
                }
            }
        }
    }
}

fn dark_on(gbuffer: &GBuffer, prepared: &gnomon_psm::PreparedPsm<'_>, object: u32) -> usize {
    let mut image = VisibilityImage::new(gbuffer.width, gbuffer.height);
    prepared.shade(gbuffer, &mut image);
    let pixels: Vec<usize> = (0..gbuffer.pixel_count()).filter(|&i| gbuffer.object[i] == object).collect();
    assert!(pixels.len() > 5000);
    pixels.into_iter().filter(|&i| image.values[i] != 1.0).count()
}

/// A light in a closed box sees all six walls through the faces of its cube, and nothing is dark.
#[test]
fn a_room_is_lit_on_all_sides_by_the_light_in_it() {
    let faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
    let corner = |i: u32| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32) * 2.0 - Vec3::ONE;
    let triangles = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let room = TriangleMesh::new("room", (0..8).map(corner).collect(), triangles);
    let mut scene = Scene::new();
    scene.add(&room, Affine3A::IDENTITY, ObjectFlags::default()).expect("sound");
    let light = Light::Point { position: Vec3::new(0.1, 0.2, -0.3) };
    for target in [Vec3::X, Vec3::NEG_X, Vec3::new(0.1, 1.0, 0.0), Vec3::Z, Vec3::NEG_Z] {
        for variant in Variant::ALL {
            let camera = camera(Vec3::new(-0.2, 0.1, 0.15), target);
            let gbuffer = raster::render_gbuffer(&scene, &camera);
            let params = PsmParams { variant, map_size: 128, ..Default::default() };
            let (prepared, _) = Psm::new(params).prepare(&scene, &light, &camera, &gbuffer);
            assert_eq!(dark_on(&gbuffer, &prepared, 0), 0, "{variant:?} towards {target}");
        }
    }
}
