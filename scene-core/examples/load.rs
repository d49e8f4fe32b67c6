//! Loads scenes and says what is in them: `cargo run --example load -- FILE…`
use std::path::PathBuf;
use std::time::Instant;

fn main() {
    for path in std::env::args_os().skip(1).map(PathBuf::from) {
        let start = Instant::now();
        match gnomon_scene_core::io::load_setup(&path) {
            Ok(setup) => {
                let scene = &setup.scene;
                println!(
                    "{}: {} triangles, {} objects, {:?} … {:?}, {:.0} ms",
                    setup.name,
                    scene.triangles().len(),
                    scene.objects().len(),
                    scene.bounds().min.to_array(),
                    scene.bounds().max.to_array(),
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
