//! Loads scenes and says what is in them: `cargo run --example load -- FILE…`
use std::path::PathBuf;
use std::time::Instant;

use gnomon_scene_core::geometry::Aabb;

fn main() {
    for path in std::env::args_os().skip(1).map(PathBuf::from) {
        let start = Instant::now();
        match gnomon_scene_core::io::load_setup(&path) {
            Ok(setup) => {
                let scene = &setup.scene;
                // The ground that a bare mesh is given is no part of it.
                let bounds = scene
                    .objects()
                    .iter()
                    .filter(|object| object.flags.casts)
                    .fold(Aabb::EMPTY, |bounds, object| bounds.union(object.bounds));
                println!(
                    "{}: {} casting triangles, {} objects, {:?} … {:?}, {:.0} ms",
                    setup.name,
                    scene.caster_count(),
                    scene.objects().len(),
                    bounds.min.to_array(),
                    bounds.max.to_array(),
                    start.elapsed().as_secs_f64() * 1e3,
                );
                println!("  {:?}\n  {:?}", setup.camera, setup.lights);
                for note in &setup.notes {
                    println!("  {note}");
                }
            }
            Err(error) => println!("error: {error}"),
        }
    }
}
