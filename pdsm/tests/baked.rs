//! Files: what was written is read again, and nothing else is.

use glam::{Affine3A, Vec3};
use gnomon_pdsm::baked::{Baked, BakedError};
use gnomon_pdsm::{Pdsm, PdsmParams, Precision};
use scene_core::geometry::ObjectFlags;
use scene_core::{Light, Scene, SceneSetup, TriangleMesh, VisibilityImage, raster, scenes};

fn params(size: u32) -> PdsmParams {
    PdsmParams { views: 9, map_size: size, pdsm_size: size, max_error: 0.02, ..Default::default() }
}

fn setup(name: &str) -> SceneSetup {
    let mut setup = scenes::build(name, 0.0).expect("a built-in scene");
    (setup.camera.width, setup.camera.height) = (96, 72);
    setup
}

fn shade(pdsm: &gnomon_pdsm::PreparedPdsm<'_>, setup: &SceneSetup) -> VisibilityImage {
    let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
    let mut image = VisibilityImage::new(gbuffer.width, gbuffer.height);
    pdsm.shade(&gbuffer, &mut image);
    image
}

#[test]
fn a_file_gives_the_image_it_was_baked_from() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("scene.pdsm");
    for name in ["quads", "cornell", "fence"] {
        let setup = setup(name);
        let light = &setup.lights[0];
        for precision in [Precision::Full, Precision::Half] {
            for only_surfaces in [false, true] {
                let params = PdsmParams { precision, only_surfaces, cascades: 0, ..params(64) };
                let (built, _) = Pdsm::new(params).prepare(&setup.scene, light);
                let (baked, _) = Pdsm::new(params).bake(&setup.scene, light);
                baked.write(&path).expect("written");
                let read = Baked::read(&path).expect("read");
                assert_eq!((read.params(), read.light()), (&params, light));
                let (prepared, _) = read.prepare(&setup.scene, light).expect("the same scene");
                assert_eq!(shade(&prepared, &setup).bits(), shade(&built, &setup).bits(), "{name}");
                assert_eq!(
                    std::fs::read_dir(folder.path()).expect("a folder").count(),
                    1,
                    "a file is left over"
                );
            }
        }
    }
}

/// A file of some kilobytes with two windows: every byte counts.
fn small_file() -> Vec<u8> {
    let setup = setup("quads");
    let params = PdsmParams { precision: Precision::Half, ..params(12) };
    Pdsm::new(params).bake(&setup.scene, &setup.lights[0]).0.to_bytes()
}

#[test]
fn every_truncation_is_refused() {
    let bytes = small_file();
    assert!(Baked::from_bytes(&bytes).is_ok());
    for length in 0..bytes.len() {
        let error = Baked::from_bytes(&bytes[..length]).expect_err("cut short");
        let is_told = matches!(error, BakedError::NotBaked | BakedError::Length { .. });
        assert!(is_told, "{length} bytes: {error}");
    }
    let longer = [&bytes[..], &[0; 4]].concat();
    assert!(matches!(Baked::from_bytes(&longer), Err(BakedError::Length { .. })));
}

#[test]
fn every_flipped_bit_is_refused() {
    let mut bytes = small_file();
    for bit in 0..8 * bytes.len() {
        bytes[bit / 8] ^= 1 << (bit % 8);
        assert!(Baked::from_bytes(&bytes).is_err(), "bit {bit}");
        bytes[bit / 8] ^= 1 << (bit % 8);
    }
}

/// Numbers changed by someone who knows how to make the checksum right: an error or an answer, never a panic.
#[test]
fn a_file_made_to_deceive_makes_no_panic() {
    let bytes = small_file();
    let setup = setup("quads");
    let words = bytes.len() / 4;
    for (word, value) in (6..words).step_by(3).zip([0, u32::MAX, 1 << 31, 0x7fc0_0000, 3].into_iter().cycle())
    {
        let mut bytes = bytes.clone();
        bytes[4 * word..4 * word + 4].copy_from_slice(&value.to_le_bytes());
        let mut crc = crc32fast::Hasher::new();
        crc.update(&bytes[..12]);
        crc.update(&bytes[16..]);
        bytes[12..16].copy_from_slice(&crc.finalize().to_le_bytes());
        if let Ok(baked) = Baked::from_bytes(&bytes)
            && let Ok((pdsm, _)) = baked.prepare(&setup.scene, &setup.lights[0])
        {
            shade(&pdsm, &setup);
        }
    }
}

#[test]
fn other_lights_and_scenes_are_refused() {
    let setup = setup("quads");
    let (baked, _) = Pdsm::new(params(16)).bake(&setup.scene, &setup.lights[0]);
    let other = Light::Point { position: Vec3::Y };
    assert!(matches!(baked.prepare(&setup.scene, &other), Err(BakedError::OtherLight)));
    let ball = scenes::build("ball", 0.0).expect("a built-in scene");
    let refused = baked.prepare(&ball.scene, &setup.lights[0]);
    assert!(matches!(refused, Err(BakedError::OtherScene { .. })));
}

/// A receiver, a caster that stands still and one that moves by `x`.
fn moving_scene(x: f32, dynamic: bool) -> Scene {
    let quad = |y: f32, half: f32| {
        let corners = [(-half, -half), (-half, half), (half, half), (half, -half)];
        let positions = corners.map(|(x, z)| Vec3::new(x, y, z)).to_vec();
        TriangleMesh::new("quad", positions, vec![[0, 1, 2], [0, 2, 3]])
    };
    let mut scene = Scene::new();
    let still = ObjectFlags::default();
    let flags = ObjectFlags { dynamic, ..still };
    for (mesh, place, flags) in
        [(quad(0.0, 3.0), 0.0, still), (quad(1.0, 0.5), -0.8, still), (quad(1.5, 0.4), x, flags)]
    {
        scene.add(&mesh, Affine3A::from_translation(Vec3::X * place), flags).expect("a sound mesh");
    }
    scene
}

/// What moves has a PDSM of its own; where one shadow falls alone that is as good as building all anew, and elsewhere V
/// lies between the larger shadow and the sum of both.
#[test]
fn moving_casters_are_added_to_what_was_baked() {
    let light =
        Light::Rect { center: Vec3::new(0.0, 5.0, 0.0), half_u: Vec3::X * 0.5, half_v: Vec3::Z * 0.5 };
    let params = PdsmParams { max_error: 0.0, ..params(256) };
    let (baked, _) = Pdsm::new(params).bake(&moving_scene(0.9, true), &light);
    for x in [0.9, 0.2, -0.4] {
        let scene = moving_scene(x, true);
        let (pdsm, report) = baked.prepare(&scene, &light).expect("what moved is dynamic");
        assert!(report.stages_ms.contains_key("prepare.events") && pdsm.moving_windows().len() == 1);
        let whole_scene = moving_scene(x, false);
        let (whole, _) = Pdsm::new(params).prepare(&whole_scene, &light);
        let points: Vec<_> = (0..60 * 60)
            .map(|i| Vec3::new((i % 60) as f32 / 12.0 - 2.5, 0.0, (i / 60) as f32 / 15.0 - 2.0))
            .collect();
        let values = |pdsm: &gnomon_pdsm::PreparedPdsm<'_>| {
            let mut values = vec![f32::NAN; points.len()];
            pdsm.visibility_at(&points, &mut values);
            values
        };
        let (apart, together) = (values(&pdsm), values(&whole));
        let (mut sum, mut shadowed) = (0.0, 0);
        for (a, b) in apart.iter().zip(&together) {
            sum += f64::from((a - b).abs());
            shadowed += usize::from(*b < 1.0);
        }
        let mean = sum / shadowed as f64;
        println!("moved to {x}: mean |difference| {mean:.4} over {shadowed} shadowed points");
        // Windows are fitted anew, so edges fall on other texels: half a texel of a penumbra some 20 texels wide. Shadows
        // that cross add what independence is wrong by, at most a quarter where both are penumbra.
        assert!(shadowed > 100 && mean < 0.04, "moved to {x}: {mean}");
    }
}
