//! What each variant is worth, on built-in scenes and on one made for the errors of `coverage`.

mod truth;

use gnomon_penumbra_wedges::{Casters, Variant};
use scene_core::scenes;
use truth::{known_errors, rmse};

const ALL: [Variant; 3] = [Variant::Interpolated, Variant::Coverage, Variant::Exact];

#[test]
fn exact_is_right_on_every_built_in_scene() {
    for built_in in scenes::all() {
        // A small forest: at a million triangles the test would take minutes, most of them for ground truth.
        let spec = if built_in.name == "forest" { "forest:triangles=60000" } else { built_in.name };
        let setup = scenes::build(spec, 0.0).expect("built in");
        let light = setup.lights[0];
        let variants =
            if Casters::new(&setup.scene).expect("edges").masked().is_some() || !light.is_extended() {
                &ALL[2..]
            } else {
                &ALL[..]
            };
        let errors = rmse(&setup.scene, &light, &setup.camera.with_size(96, 72), variants, 2048);
        println!("{}: {errors:.4?}", built_in.name);
        assert!(errors.last().is_some_and(|&e| e < 0.01), "{}: {errors:?}", built_in.name);
    }
}

/// Two sheets that hide the same part of the light count twice with `coverage`; a silhouette that changes over a wide
/// light is taken from its middle.
#[test]
fn the_known_errors_of_coverage_are_not_those_of_exact() {
    let (scenes, view) = known_errors();
    for (what, scene, light) in &scenes {
        let errors = rmse(scene, light, &view, &ALL, 1024);
        println!("{what}: {errors:.4?}");
        let [_, coverage, exact] = errors[..] else { panic!("three variants") };
        assert!(exact < 0.006, "{what}: {errors:?}");
        assert!(coverage > 3.0 * exact, "{what}: {errors:?}");
    }
}
