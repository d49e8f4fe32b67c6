//! Loading beside the bare cost of parsing, in one run: `cargo bench -p gnomon-scene-core --bench loading`.
//!
//! `tobj` alone is `load_obj_buf` on the file's bytes, polygons kept; `gltf` alone is the crate's JSON parsing
//! without validation and the reading of buffers. Both leave out what a scene needs beyond it: checks,
//! repairs, flattening to world space. Times are on the processor, the smallest of several means.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use gnomon_scene_core::io::load_setup;

/// Seconds that this thread has run, where the system tells; wall time elsewhere. Loading uses one thread, and
/// time on the processor is not disturbed by what else the machine does.
fn clock(start: Instant) -> f64 {
    fs::read_to_string("/proc/thread-self/schedstat")
        .ok()
        .and_then(|text| text.split_whitespace().next()?.parse::<f64>().ok())
        .map_or_else(|| start.elapsed().as_secs_f64(), |nanoseconds| nanoseconds * 1e-9)
}

/// Seconds that `work` takes, as a mean over a tenth of a second: the clock above ticks coarsely.
fn time<T>(work: impl Fn() -> T) -> f64 {
    let (start, mut runs) = (Instant::now(), 0);
    let before = clock(start);
    while runs == 0 || start.elapsed().as_secs_f64() < 0.1 {
        std::hint::black_box(work());
        runs += 1;
    }
    (clock(start) - before) / f64::from(runs)
}

/// A wavy grid of `n` × `n` cells, as quads or triangles, with normals and texture coordinates if asked for.
fn grid_obj(n: usize, quads: bool, attributes: bool) -> String {
    use std::fmt::Write;
    let mut text = String::new();
    for y in 0..=n {
        for x in 0..=n {
            let (x, y) = (x as f32 / n as f32, y as f32 / n as f32);
            let _ = writeln!(text, "v {x:.6} {:.6} {y:.6}", (x * 20.0).sin() * (y * 20.0).cos() * 0.1);
            if attributes {
                let _ = writeln!(text, "vt {x:.4} {y:.4}\nvn 0 1 0");
            }
        }
    }
    let corner = |i: usize| if attributes { format!("{i}/{i}/{i}") } else { i.to_string() };
    for y in 0..n {
        for x in 0..n {
            let a = y * (n + 1) + x + 1;
            let [a, b, c, d] = [a, a + 1, a + n + 2, a + n + 1].map(corner);
            let _ = if quads {
                writeln!(text, "f {a} {b} {c} {d}")
            } else {
                writeln!(text, "f {a} {b} {c}\nf {a} {c} {d}")
            };
        }
    }
    text
}

/// A grid as glTF with an external buffer.
fn write_grid_gltf(folder: &Path, n: u32) -> PathBuf {
    let vertices = (n + 1) * (n + 1);
    let mut bytes: Vec<u8> = Vec::new();
    for i in 0..vertices {
        let (x, y) = ((i % (n + 1)) as f32 / n as f32, (i / (n + 1)) as f32 / n as f32);
        let height = (x * 20.0).sin() * (y * 20.0).cos() * 0.1;
        bytes.extend([x, height, y].iter().flat_map(|v| v.to_le_bytes()));
    }
    let indices_at = bytes.len();
    for cell in 0..n * n {
        let a = cell / n * (n + 1) + cell % n;
        let corners = [a, a + 1, a + n + 2, a, a + n + 2, a + n + 1];
        bytes.extend(corners.iter().flat_map(|i| i.to_le_bytes()));
    }
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}],
        "buffers":[{{"byteLength":{},"uri":"grid.bin"}}],
        "bufferViews":[{{"buffer":0,"byteLength":{indices_at}}},{{"buffer":0,"byteOffset":{indices_at},"byteLength":{}}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":{vertices},"type":"VEC3"}},
        {{"bufferView":1,"componentType":5125,"count":{},"type":"SCALAR"}}]}}"#,
        bytes.len(),
        bytes.len() - indices_at,
        6 * n * n
    );
    fs::write(folder.join("grid.bin"), bytes).expect("the folder is writable");
    let path = folder.join("grid.gltf");
    fs::write(&path, json).expect("the folder is writable");
    path
}

/// The bare cost of an OBJ file.
fn parse_obj(path: &Path) -> usize {
    let bytes = fs::read(path).expect("the file was there before");
    let options = tobj::LoadOptions::default();
    let materials = |_: &Path| Ok(Default::default());
    tobj::load_obj_buf(&mut &bytes[..], &options, materials).map_or(0, |(models, _)| models.len())
}

/// The bare cost of a glTF file with buffers beside it.
fn parse_gltf(path: &Path) -> usize {
    let bytes = fs::read(path).expect("the file was there before");
    let parsed = gltf::Gltf::from_slice_without_validation(&bytes).expect("the file is sound");
    let folder = path.parent().unwrap_or(Path::new(""));
    let buffers = parsed.document.as_json().buffers.iter().filter_map(|buffer| buffer.uri.as_ref());
    buffers.map(|uri| fs::read(folder.join(uri)).map_or(0, |bytes| bytes.len())).sum()
}

fn report(name: &str, path: &Path, bytes: u64, bare: impl Fn(&Path) -> usize) {
    let triangles = match load_setup(path) {
        Ok(setup) => setup.scene.triangles().len(),
        Err(error) => return println!("{error}"),
    };
    // Interleaved, so that a busy machine disturbs both alike.
    let (mut parsing, mut loading) = (f64::INFINITY, f64::INFINITY);
    for _ in 0..7 {
        parsing = parsing.min(time(|| bare(path)));
        loading = loading.min(time(|| load_setup(path)));
    }
    println!(
        "{name:<34} {:>7.2} MB {:>8.1} ms {:>7.1} ms {:>6.2}× {:>8.0} MB/s {:>7.2} Mtri/s",
        bytes as f64 * 1e-6,
        parsing * 1e3,
        loading * 1e3,
        loading / parsing,
        bytes as f64 * 1e-6 / loading,
        triangles as f64 * 1e-6 / loading,
    );
}

fn main() {
    let folder = tempfile::tempdir().expect("there is a temporary folder");
    println!("{:<34} {:>10} {:>11} {:>10} {:>7}", "", "size", "parsing", "loading", "ratio");
    for (name, quads, attributes) in [
        ("OBJ, 200k triangles", false, false),
        ("OBJ, 100k quads", true, false),
        ("OBJ, 200k triangles, vt and vn", false, true),
    ] {
        let path = folder.path().join("grid.obj");
        let text = grid_obj(316, quads, attributes);
        fs::write(&path, &text).expect("the folder is writable");
        report(name, &path, text.len() as u64, parse_obj);
    }
    let path = write_grid_gltf(folder.path(), 316);
    let size = |name: &str| fs::metadata(folder.path().join(name)).map_or(0, |m| m.len());
    report("glTF, 200k triangles", &path, size("grid.gltf") + size("grid.bin"), parse_gltf);

    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/scenes");
    for name in ["dragon.obj", "sedan.obj", "biplane.obj"] {
        let path = scenes.join(name);
        if let Ok(metadata) = fs::metadata(&path) {
            report(name, &path, metadata.len(), parse_obj);
        }
    }
    let path = scenes.join("gltf/FlightHelmet.gltf");
    if let Ok(metadata) = fs::metadata(scenes.join("gltf/FlightHelmet.bin")) {
        report("FlightHelmet.gltf", &path, metadata.len(), parse_gltf);
    }
}
