//! Every built-in scene: its counts, its determinism, and that it is what a technique may rely on.

use std::collections::BTreeSet;
use std::time::{Duration, Instant};

use gnomon_scene_core::geometry::{EdgeTopology, ObjectFlags};
use gnomon_scene_core::raster::render_gbuffer;
use gnomon_scene_core::scenes::{BuiltIn, SceneSpecError, all, build};
use gnomon_scene_core::{Scene, SceneSetup};

fn setup(spec: &str, time: f32) -> SceneSetup {
    build(spec, time).unwrap_or_else(|error| panic!("{spec}: {error}"))
}

/// Every byte that a scene's picture depends on.
fn bytes(setup: &SceneSetup) -> Vec<u32> {
    let scene = &setup.scene;
    let positions = scene.positions().iter().flat_map(|p| p.to_array()).map(f32::to_bits);
    let uvs = scene.uvs().iter().flat_map(|p| p.to_array()).map(f32::to_bits);
    positions.chain(uvs).chain(scene.triangles().iter().flatten().copied()).collect()
}

fn spec_of(scene: &BuiltIn, settings: &[(&str, f64)]) -> String {
    let settings: Vec<_> = settings.iter().map(|(key, value)| format!("{key}={value}")).collect();
    format!("{}:{}", scene.name, settings.join(","))
}

#[test]
fn counts_are_the_promised_ones() {
    for scene in all() {
        if let Some(counts) = scene.counts {
            for time in [0.0, 1.7] {
                let built = setup(scene.name, time).scene;
                // The part of a mesh that a mask cuts is an object of its own, of the same vertices.
                let mut meshes: Vec<_> =
                    built.objects().iter().map(|object| object.vertices.clone()).collect();
                meshes.dedup();
                let found = (built.positions().len(), built.triangles().len(), meshes.len());
                assert_eq!(found, (counts.vertices, counts.triangles, counts.meshes), "{}", scene.name);
            }
        }
    }
}

#[test]
fn counts_of_the_contact_hardening_paper() {
    let table = [
        ("fence", 16, 24, 2),
        ("ball", 880, 1752, 2),
        ("log-cabin", 1407, 2630, 13),
        ("pool", 8463, 11_003, 1),
    ];
    for (name, vertices, triangles, meshes) in table {
        let counts = all().iter().find(|s| s.name == name).unwrap().counts.unwrap();
        assert_eq!((counts.vertices, counts.triangles, counts.meshes), (vertices, triangles, meshes));
    }
}

#[test]
fn every_scene_is_valid_seen_and_lit() {
    for scene in all() {
        let setup = setup(scene.name, 0.0);
        setup.camera.validate().unwrap_or_else(|e| panic!("{}: {e}", scene.name));
        assert_eq!((setup.camera.width, setup.camera.height), (512, 512));
        assert_eq!(setup.lights.len(), 1, "{}", scene.name);
        setup.lights[0].validate().unwrap_or_else(|e| panic!("{}: {e}", scene.name));
        assert!(setup.scene.caster_count() > 0);
        assert!(setup.scene.objects().iter().all(|o| !o.name.is_empty()), "{}", scene.name);
        // Most of the picture shows the scene, and a good part of that could be lit or in shadow: it is
        // turned to the light, all of which lies above its plane.
        let camera = setup.camera.with_size(128, 128);
        let gbuffer = render_gbuffer(&setup.scene, &camera);
        let seen: Vec<_> = (0..gbuffer.pixel_count()).filter(|&p| gbuffer.is_seen(p)).collect();
        let light = setup.lights[0];
        let comparable =
            seen.iter().filter(|&&p| light.is_above_plane(gbuffer.position[p], gbuffer.normal[p]));
        assert!(seen.len() * 2 > gbuffer.pixel_count(), "{}: {} seen", scene.name, seen.len());
        let comparable = comparable.count();
        assert!(comparable * 2 > seen.len(), "{}: {comparable} of {} comparable", scene.name, seen.len());
    }
}

#[test]
fn no_triangle_is_degenerate() {
    for scene in all() {
        let setup = setup(scene.name, 0.0);
        let edges = EdgeTopology::of_scene(&setup.scene, |_| true).unwrap();
        assert_eq!(edges.statistics().degenerate, 0, "{}", scene.name);
    }
}

#[test]
fn the_same_spec_gives_the_same_bytes_and_another_seed_others() {
    for scene in all() {
        let first = bytes(&setup(scene.name, 0.5));
        assert!(first == bytes(&setup(scene.name, 0.5)), "{}", scene.name);
        if scene.parameters.iter().any(|p| p.name == "seed") {
            assert!(first != bytes(&setup(&spec_of(scene, &[("seed", 2.0)]), 0.5)), "{}", scene.name);
        }
    }
}

#[test]
fn time_moves_what_is_flagged_and_nothing_else() {
    let mut moving = BTreeSet::new();
    for scene in all() {
        let (before, after) = (setup(scene.name, 0.0).scene, setup(scene.name, 0.9).scene);
        assert_eq!(before.objects().len(), after.objects().len());
        for (a, b) in before.objects().iter().zip(after.objects()) {
            let same = before.positions()[a.vertices.clone()] == after.positions()[b.vertices.clone()];
            assert_eq!(same, !a.flags.dynamic, "{}: {}", scene.name, a.name);
            assert_eq!(a.flags, ObjectFlags { dynamic: !same, ..Default::default() });
            if !same {
                moving.insert(scene.name);
            }
        }
    }
    assert_eq!(moving.into_iter().collect::<Vec<_>>(), ["ball", "edges", "knot", "street"]);
}

#[test]
fn ends_of_every_range_work_and_beyond_them_is_refused() {
    for scene in all() {
        for p in scene.parameters {
            assert!(p.min <= p.default && p.default <= p.max && p.min < p.max, "{} {}", scene.name, p.name);
            assert!(!p.doc.is_empty());
            for value in [p.min, p.max] {
                // The largest sizes are another test's; here they would take minutes in all.
                let heavy = matches!(
                    (scene.name, p.name),
                    ("forest", "triangles") | ("park", "leaves") | ("knot", "sides") | ("street", "length")
                );
                if !(heavy && value == p.max) {
                    let setup = setup(&spec_of(scene, &[(p.name, value)]), 0.0);
                    setup.camera.validate().unwrap();
                    setup.lights[0].validate().unwrap_or_else(|e| panic!("{} {}: {e}", scene.name, p.name));
                }
            }
            for value in [p.min - 1.0, p.max + 1.0, f64::NAN, f64::INFINITY] {
                let refused = build(&spec_of(scene, &[(p.name, value)]), 0.0);
                assert!(matches!(refused, Err(SceneSpecError::BadValue { .. })), "{} {}", scene.name, p.name);
            }
        }
    }
}

#[test]
fn scenes_are_built_within_their_time() {
    for scene in all() {
        let start = Instant::now();
        let triangles = setup(scene.name, 0.0).scene.triangles().len();
        // The largest takes a tenth of a second: the bound is for mistakes in the order of growth.
        assert!(start.elapsed() < Duration::from_secs(1), "{}: {triangles} triangles", scene.name);
    }
}

#[test]
fn sizes_follow_their_parameters() {
    let triangles = |spec: &str| setup(spec, 0.0).scene.triangles().len();
    for budget in [1_000, 7_000, 20_000, 123_456, 2_500_000] {
        let found = triangles(&format!("forest:triangles={budget}"));
        assert!(found <= budget && budget - found < 60, "{found} of {budget}");
    }
    assert!(triangles("park") >= 100_000);
    assert_eq!(triangles("knot:sides=10"), 2 + 2 * 160 * 10);
    assert_eq!(triangles("quads:squares=9"), 2 + 2 * 9);
}

#[test]
fn knot_and_cabin_are_closed_surfaces() {
    for (spec, skip) in [("knot:sides=12", "plane"), ("log-cabin", ""), ("edges", ""), ("layers", "")] {
        let scene: Scene = setup(spec, 0.0).scene;
        for object in scene.objects().iter().filter(|o| o.name != skip) {
            let triangles = &scene.triangles()[object.triangles.clone()];
            let statistics = EdgeTopology::new(scene.positions(), triangles).unwrap().statistics();
            let faults = (statistics.boundary, statistics.flipped);
            assert_eq!(faults, (0, 0), "{spec}: {}", object.name);
        }
    }
}

#[test]
fn unknown_names_say_what_there_is() {
    let message = build("dragon", 0.0).unwrap_err().to_string();
    assert!(all().iter().all(|scene| message.contains(scene.name)), "{message}");
    let message = build("knot:twist=3", 0.0).unwrap_err().to_string();
    assert!(message.contains("'twist'") && message.contains("sides (3 to 2048)"), "{message}");
    assert!(matches!(build("knot", f32::NAN), Err(SceneSpecError::Time(_))));
}
