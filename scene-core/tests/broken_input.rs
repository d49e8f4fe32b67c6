//! Every file of `tests/broken`, and some that are made here, is refused with a message that names the file
//! and the place. The snapshot holds all messages: read them as the one who made the mistake.

use std::fs;
use std::path::{Path, PathBuf};

use gnomon_scene_core::io::{Limits, LoadError, LoadOptions, load_setup, load_setup_with};

fn broken_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/broken")
}

/// The message for `path`, without its folder, on one line of bounded length.
fn message(path: &Path, folder: &Path) -> String {
    let outcome = std::panic::catch_unwind(|| load_setup(path));
    let error = match outcome {
        Ok(Err(error)) => error,
        Ok(Ok(setup)) => panic!("{} was loaded: {:?}", path.display(), setup.notes),
        Err(_) => panic!("{} made the loader panic", path.display()),
    };
    readable(&error, path, folder)
}

fn readable(error: &LoadError, path: &Path, folder: &Path) -> String {
    let text = error.to_string();
    let name = path.file_name().unwrap().to_string_lossy().into_owned();
    assert!(text.contains(&name), "{name} is not named: {text}");
    assert!(!text.contains('\n'), "{text}");
    assert!(text.len() < 600, "{text}");
    text.replace(&format!("{}/", folder.display()), "")
}

#[test]
fn every_broken_file_is_refused_by_name_and_place() {
    let folder = broken_folder();
    let mut paths: Vec<_> =
        fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).filter(|p| p.is_file()).collect();
    paths.sort();
    assert!(paths.len() >= 100, "only {} broken files were found", paths.len());
    let messages: Vec<_> = paths.iter().map(|path| message(path, &folder)).collect();
    insta::assert_snapshot!("files", messages.join("\n"));
}

#[test]
fn the_parts_of_broken_files_are_sound() {
    // Otherwise the others would be refused for the wrong reason.
    for part in ["parts/triangle.obj", "parts/triangle.gltf"] {
        let setup = load_setup(&broken_folder().join(part)).unwrap();
        assert_eq!(setup.scene.objects()[0].triangles.len(), 1);
    }
}

/// A binary glTF file of a JSON and a BIN chunk.
fn glb(json: &[u8], binary: &[u8]) -> Vec<u8> {
    let padded = |bytes: &[u8], filler: u8| {
        let mut bytes = bytes.to_vec();
        bytes.resize(bytes.len().next_multiple_of(4), filler);
        bytes
    };
    let (json, binary) = (padded(json, b' '), padded(binary, 0));
    let mut file = b"glTF".to_vec();
    file.extend(2u32.to_le_bytes());
    file.extend((28 + json.len() as u32 + binary.len() as u32).to_le_bytes());
    file.extend((json.len() as u32).to_le_bytes());
    file.extend(b"JSON");
    file.extend(json);
    file.extend((binary.len() as u32).to_le_bytes());
    file.extend(b"BIN\0");
    file.extend(binary);
    file
}

const TRIANGLE_JSON: &str = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],"buffers":[{"byteLength":36}],
"bufferViews":[{"buffer":0,"byteLength":36}],
"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}]}"#;

fn triangle_bytes(corners: [f32; 9]) -> Vec<u8> {
    corners.iter().flat_map(|c| c.to_le_bytes()).collect()
}

const TRIANGLE: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];

#[test]
fn binary_files_are_refused_by_name_and_place() {
    let folder = tempfile::tempdir().unwrap();
    let sound = glb(TRIANGLE_JSON.as_bytes(), &triangle_bytes(TRIANGLE));
    let path = folder.path().join("sound.glb");
    fs::write(&path, &sound).unwrap();
    assert_eq!(load_setup(&path).unwrap().scene.objects()[0].triangles.len(), 1);

    let changed = |at: usize, bytes: &[u8]| {
        let mut file = sound.clone();
        file[at..at + bytes.len()].copy_from_slice(bytes);
        file
    };
    let noise: Vec<u8> = (0..4096u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
    let nan = triangle_bytes(TRIANGLE.map(|c| if c == 1.0 { f32::NAN } else { c }));
    let png_of_no_size = {
        let mut png = b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR".to_vec();
        png.extend([0; 8]);
        png.extend([8, 6, 0, 0, 0, 0x3b, 0x8b, 0x7c, 0x12]);
        png
    };
    let huge_polygon = {
        // A zigzag that crosses itself everywhere: too large to be mended.
        let mut text = String::new();
        for i in 0..6000u32 {
            text += &format!("v {} {} 0\n", (i * 7919) % 6007, (i * 104_729) % 5987);
        }
        text += "f";
        (1..=6000).for_each(|i| text += &format!(" {i}"));
        text.into_bytes()
    };
    fs::write(folder.path().join("mask.png"), &png_of_no_size).unwrap();
    fs::write(folder.path().join("mask.mtl"), "newmtl leaf\nmap_d mask.png\n").unwrap();
    fs::write(folder.path().join("noise.mtl"), "newmtl leaf\nmap_d noise.obj\n").unwrap();
    fs::write(folder.path().join("options.mtl"), "newmtl leaf\nmap_d -hue 3 mask.png\n").unwrap();
    let masked = |mtl: &str| {
        format!("mtllib {mtl}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl leaf\nf 1/1 2/1 3/1\n").into_bytes()
    };
    let cases: Vec<(&str, Vec<u8>)> = vec![
        ("bad_magic.glb", changed(0, b"GLTF")),
        ("version_1.glb", changed(4, &1u32.to_le_bytes())),
        ("truncated_header.glb", sound[..10].to_vec()),
        ("truncated_json.glb", sound[..100].to_vec()),
        ("truncated_binary.glb", sound[..sound.len() - 8].to_vec()),
        ("length_too_small.glb", changed(8, &5u32.to_le_bytes())),
        ("json_chunk_too_long.glb", changed(12, &u32::MAX.to_le_bytes())),
        ("chunks_swapped.glb", changed(16, b"BIN\0")),
        ("nan.glb", glb(TRIANGLE_JSON.as_bytes(), &nan)),
        ("short_binary.glb", glb(TRIANGLE_JSON.as_bytes(), &triangle_bytes(TRIANGLE)[..20])),
        ("noise.obj", noise.clone()),
        ("noise.gltf", noise.clone()),
        ("noise.glb", noise.clone()),
        ("noise.toml", noise.clone()),
        ("noise.json", noise),
        ("not_utf8.toml", b"name = \"caf\xe9\"\nmeshes = []\n".to_vec()),
        ("not_utf8.json", b"{ \"name\":\n  \"caf\xe9\" }".to_vec()),
        ("mask_without_texels.obj", masked("mask.mtl")),
        ("mask_is_noise.obj", masked("noise.mtl")),
        ("mask_with_unknown_option.obj", masked("options.mtl")),
        ("huge_polygon.obj", huge_polygon),
    ];
    let mut messages = Vec::new();
    for (name, bytes) in &cases {
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        messages.push(message(&path, folder.path()));
    }
    messages.push(message(&folder.path().join("no_such_file.obj"), folder.path()));
    let directory = folder.path().join("directory.obj");
    fs::create_dir(&directory).unwrap();
    messages.push(message(&directory, folder.path()));
    insta::assert_snapshot!("binary", messages.join("\n"));
}

#[test]
fn limits_are_kept_and_named() {
    let folder = broken_folder();
    let path = folder.join("parts/triangle.obj");
    let limited = |limits| {
        let error = load_setup_with(&path, &LoadOptions { limits, ..Default::default() }).unwrap_err();
        readable(&error, &path, &folder)
    };
    let limits = Limits::default();
    insta::assert_snapshot!(
        "limits",
        [limited(Limits { file_bytes: 10, ..limits }), limited(Limits { triangles: 0, ..limits }),]
            .join("\n")
    );
}
