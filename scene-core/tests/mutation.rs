//! Thousands of damaged files: none may make the loaders panic, run away with memory or hang.

use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::time::{Duration, Instant};

use gnomon_scene_core::io::load_setup;

const MUTANTS_PER_SEED: u64 = 2_000;

const OBJ: &str = "mtllib leaf.mtl\no box\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0.5 0.5 1\nv 0.5 0.25 0\n\
vt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\nf 1 2 3 4\nf 1 2 6 3 4\nf -6//1 -5//1 -2//1\ng top\nusemtl leaf\n\
f 1/1/1 2/2/1 5/3/1\nf 2/1 3/2 \\\n5/3\nl 1 2 3\nv 2 0 0 0.5 0.5 0.5\nf 1 2 7 # last\n";
const MTL: &str = "# leaves\nnewmtl stem\nKd 0.5\nmap_Kd stem.png\n\nnewmtl leaf\nd 1\nmap_d -s 2 2 1 -clamp on leaf.png\nillum 2\n";
const TOML: &str = "name = \"mutant\"\nmeshes = [\"plain.obj\", { file = \"plain.obj\", translate = [0, 1, 0], rotate = [90, 0, 0], scale = 0.5, casts = true }]\n\
[camera]\neye = [0, 2, 6]\ntarget = [0, 0.5, 0]\nup = [0, 1, 0]\nfov_y_deg = 40\nnear = 0.1\nfar = 100\nwidth = 64\nheight = 48\n\
[[lights]]\nkind = \"rect\"\ncenter = [1, 5, 2]\nhalf_u = [0.5, 0, 0]\nhalf_v = [0, 0, 0.5]\n\
[[lights]]\nkind = \"spot\"\nposition = [0, 5, 0]\ndirection = [0, -1, 0]\nouter_deg = 30\ninner_deg = 20\n";
const JSON: &str = r#"{ "name": "mutant", "meshes": ["plain.obj", { "file": "plain.obj", "scale": [1, 2, 3], "rotate": [0, 0, 0, 1] }],
 "camera": { "eye": [0, 2, 6], "target": [0, 0.5, 0], "fov_y_deg": 40 },
 "light": { "kind": "directional", "direction": [0, -1, 0], "angular_radius_deg": 0.27 } }"#;
const PLAIN: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

/// Positions and texture coordinates of four vertices, six indices of 16 bits, and one sparse value.
fn gltf_binary() -> Vec<u8> {
    let positions: [f32; 12] = [0., 0., 0., 1., 0., 0., 1., 1., 0., 0., 1., 0.];
    let uvs: [f32; 8] = [0., 0., 1., 0., 1., 1., 0., 1.];
    let mut bytes: Vec<u8> = positions.iter().chain(&uvs).flat_map(|f| f.to_le_bytes()).collect();
    bytes.extend([0u16, 1, 2, 0, 2, 3].iter().flat_map(|i| i.to_le_bytes()));
    bytes.extend([3u16, 0].iter().flat_map(|i| i.to_le_bytes()));
    bytes.extend([0.0f32, 2.0, 0.0].iter().flat_map(|f| f.to_le_bytes()));
    bytes
}

fn gltf_json(uri: &str) -> String {
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0,3]}}],
"nodes":[{{"mesh":0,"children":[1,2],"translation":[0,1,0],"rotation":[0,0,0,1]}},{{"mesh":0,"scale":[2,2,2]}},
{{"camera":0,"matrix":[1,0,0,0,0,1,0,0,0,0,1,0,0,0,5,1]}},{{"extensions":{{"KHR_lights_punctual":{{"light":0}}}}}}],
"extensions":{{"KHR_lights_punctual":{{"lights":[{{"type":"spot","spot":{{"innerConeAngle":0.2,"outerConeAngle":0.5}}}}]}}}},
"cameras":[{{"type":"perspective","perspective":{{"yfov":0.7,"znear":0.1,"zfar":100,"aspectRatio":1.5}}}}],
"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"TEXCOORD_0":1}},"indices":2,"material":0,"mode":4}},
{{"attributes":{{"POSITION":0}},"mode":5}},{{"attributes":{{"POSITION":0}},"mode":6}}]}}],
"materials":[{{"alphaMode":"MASK","alphaCutoff":0.4,"pbrMetallicRoughness":{{"baseColorTexture":{{"index":0,"texCoord":0}}}}}}],
"textures":[{{"source":0,"sampler":0}}],"samplers":[{{"wrapS":33071,"wrapT":33648}}],"images":[{{"uri":"leaf.png"}}],
"buffers":[{{"byteLength":108{uri}}}],
"bufferViews":[{{"buffer":0,"byteLength":48,"byteStride":12}},{{"buffer":0,"byteOffset":48,"byteLength":32}},
{{"buffer":0,"byteOffset":80,"byteLength":12}},{{"buffer":0,"byteOffset":92,"byteLength":4}},{{"buffer":0,"byteOffset":96,"byteLength":12}}],
"accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3","sparse":{{"count":1,
"indices":{{"bufferView":3,"componentType":5123}},"values":{{"bufferView":4}}}}}},
{{"bufferView":1,"componentType":5126,"count":4,"type":"VEC2"}},{{"bufferView":2,"componentType":5123,"count":6,"type":"SCALAR"}}]}}"#
    )
}

fn glb() -> Vec<u8> {
    let mut json = gltf_json("").into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let binary = gltf_binary();
    let mut file = b"glTF".to_vec();
    for word in [2, 28 + json.len() as u32 + binary.len() as u32, json.len() as u32] {
        file.extend(word.to_le_bytes());
    }
    file.extend(b"JSON");
    file.extend(json);
    file.extend((binary.len() as u32).to_le_bytes());
    file.extend(b"BIN\0");
    file.extend(binary);
    file
}

/// A PNG of 4 × 4 texels with alpha.
fn png() -> Vec<u8> {
    let picture = image::RgbaImage::from_fn(4, 4, |x, y| image::Rgba([200, 100, 50, ((x ^ y) * 80) as u8]));
    let mut bytes = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

/// `xorshift64*`: small, and the same everywhere.
struct Random(u64);

impl Random {
    fn below(&mut self, bound: usize) -> usize {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 33) as usize % bound.max(1)
    }

    fn pick<'a, T>(&mut self, items: &'a [T]) -> &'a T {
        &items[self.below(items.len())]
    }
}

/// Numbers that break careless code.
const NUMBERS: [&str; 16] = [
    "0",
    "-1",
    "1",
    "255",
    "65536",
    "2147483648",
    "4294967295",
    "4294967296",
    "9223372036854775807",
    "18446744073709551615",
    "-9223372036854775808",
    "1e39",
    "-1e39",
    "nan",
    "1e-320",
    "0.5",
];

/// The ranges of runs of bytes that satisfy `belongs`.
fn runs(bytes: &[u8], belongs: impl Fn(u8) -> bool) -> Vec<std::ops::Range<usize>> {
    let mut runs = Vec::new();
    let mut start = None;
    for (at, &byte) in bytes.iter().chain(b"\n").enumerate() {
        match (start, belongs(byte) && at < bytes.len()) {
            (None, true) => start = Some(at),
            (Some(from), false) => {
                runs.push(from..at);
                start = None;
            }
            _ => {}
        }
    }
    runs
}

/// A damaged copy of `seed`.
fn mutate(seed: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = seed.to_vec();
    for _ in 0..=random.below(3) {
        if bytes.is_empty() {
            break;
        }
        let at = random.below(bytes.len());
        match random.below(8) {
            0 => bytes[at] ^= 1 << random.below(8),
            1 => bytes[at] = random.below(256) as u8,
            2 => bytes.truncate(at),
            3 => {
                let numbers = runs(&bytes, |b| b.is_ascii_digit() || b == b'-' || b == b'.');
                if !numbers.is_empty() {
                    let range = random.pick(&numbers).clone();
                    bytes.splice(range, random.pick(&NUMBERS).bytes());
                }
            }
            4 => {
                let words = runs(&bytes, |b| b.is_ascii_alphanumeric() || b == b'_');
                if !words.is_empty() {
                    let (a, b) = (random.pick(&words).clone(), random.pick(&words).clone());
                    let word = bytes[b].to_vec();
                    bytes.splice(a, word);
                }
            }
            5 => {
                let end = (at + 1 + random.below(40)).min(bytes.len());
                bytes.drain(at..end);
            }
            6 => {
                let end = (at + 1 + random.below(40)).min(bytes.len());
                let copy = bytes[at..end].to_vec();
                bytes.splice(at..at, copy);
            }
            _ => {
                let lines = runs(&bytes, |b| b != b'\n' && b != b',');
                let (a, b) = (random.pick(&lines).clone(), random.pick(&lines).clone());
                let line = bytes[b].to_vec();
                bytes.splice(a, line);
            }
        }
    }
    bytes
}

/// Loads mutants of `seed`, stored as `file`, through `entry`.
fn survive(folder: &Path, file: &str, entry: &str, seed: &[u8]) {
    let path = folder.join(file);
    fs::write(&path, seed).unwrap();
    let sound = load_setup(&folder.join(entry));
    assert!(sound.is_ok(), "the seed of {file} does not load: {:?}", sound.err());
    let mut random = Random(0x9e37_79b9_7f4a_7c15 ^ seed.len() as u64);
    let (mut loaded, mut slowest) = (0, Duration::ZERO);
    for number in 0..MUTANTS_PER_SEED {
        let mutant = mutate(seed, &mut random);
        // A new file each time: some file systems write to the disk at once what replaces a file's contents.
        fs::remove_file(&path).unwrap();
        fs::write(&path, &mutant).unwrap();
        let start = Instant::now();
        let outcome = catch_unwind(AssertUnwindSafe(|| load_setup(&folder.join(entry))));
        slowest = slowest.max(start.elapsed());
        let text = String::from_utf8_lossy(&mutant);
        match outcome {
            Err(_) => panic!("mutant {number} of {file} makes the loader panic:\n{text}"),
            Ok(Err(error)) => assert!(!error.to_string().is_empty()),
            Ok(Ok(setup)) => {
                loaded += 1;
                // A line of an OBJ file or a corner of a glTF file takes more than a byte each.
                let most = 8 * mutant.len() + 1000;
                let scene = &setup.scene;
                assert!(
                    scene.triangles().len() <= most && scene.positions().len() <= most,
                    "{file}:\n{text}"
                );
                assert!(scene.positions().iter().all(|p| p.is_finite()), "{file}:\n{text}");
                assert_eq!(setup.camera.validate(), Ok(()), "{file}:\n{text}");
                assert!(setup.lights.iter().all(|l| l.validate().is_ok()) && !setup.lights.is_empty());
            }
        }
    }
    fs::write(&path, seed).unwrap();
    assert!(slowest < Duration::from_secs(5), "a mutant of {file} took {slowest:?}");
    // Otherwise the mutants are too broken to reach anything behind the parsers.
    assert!(loaded * 50 > MUTANTS_PER_SEED, "only {loaded} mutants of {file} still load");
}

/// A folder with all sound files.
fn seeds() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in [
        ("leaf.png", png()),
        ("leaf.mtl", MTL.into()),
        ("plain.obj", PLAIN.into()),
        ("box.obj", OBJ.into()),
        ("box.bin", gltf_binary()),
        ("box.gltf", gltf_json(r#","uri":"box.bin""#).into_bytes()),
    ] {
        fs::write(folder.path().join(name), bytes).unwrap();
    }
    folder
}

#[test]
fn damaged_obj_files() {
    let folder = seeds();
    survive(folder.path(), "box.obj", "box.obj", OBJ.as_bytes());
    survive(folder.path(), "leaf.mtl", "box.obj", MTL.as_bytes());
    survive(folder.path(), "leaf.png", "box.obj", &png());
}

#[test]
fn damaged_gltf_files() {
    let folder = seeds();
    survive(folder.path(), "box.gltf", "box.gltf", gltf_json(r#","uri":"box.bin""#).as_bytes());
    survive(folder.path(), "box.bin", "box.gltf", &gltf_binary());
    survive(folder.path(), "box.glb", "box.glb", &glb());
}

#[test]
fn damaged_scene_files() {
    let folder = seeds();
    survive(folder.path(), "scene.toml", "scene.toml", TOML.as_bytes());
    survive(folder.path(), "scene.json", "scene.json", JSON.as_bytes());
}
