//! Bad usage and input: an exit code, one message that names the fault, and nothing written.

use crate::workbench::Workbench;

/// Runs a command that has to fail in a folder of `files`, and checks that it names `fault` and leaves the
/// folder as it was.
fn fails(code: i32, files: &[(&str, &[u8])], arguments: &[&str], fault: &str) {
    let bench = Workbench::new();
    for (name, bytes) in files {
        bench.write(name, bytes);
    }
    let before = bench.names(".");
    let said = bench.run(arguments);
    assert_eq!(said.code, code, "{arguments:?}: {}", said.stderr);
    assert_eq!(said.stdout, "", "{arguments:?}");
    assert!(said.stderr.contains(fault), "{arguments:?} does not name '{fault}': {}", said.stderr);
    assert!(!said.stderr.contains("panicked"), "{arguments:?}: {}", said.stderr);
    assert_eq!(bench.names("."), before, "{arguments:?} left something behind");
    if let Some(line) = said.stderr.strip_prefix("gnomon: ") {
        assert_eq!(line.lines().count(), 1, "{arguments:?}: {line}");
    }
}

#[test]
fn usage() {
    let render = ["render", "quads", "--technique", "shadow-map", "--out", "out"];
    let with = |more: &[&'static str]| [&render[..], more].concat();
    let rows: &[(Vec<&str>, &str)] = &[
        (vec!["frobnicate"], "frobnicate"),
        (vec!["compare"], "<SCENE>"),
        (vec!["render", "quads", "--out", "out"], "--technique"),
        (vec!["render", "quads", "--technique", "shadow-map"], "--out"),
        (vec!["reference", "quads"], "--out"),
        (with(&["--size", "0x4"]), "640x480"),
        (with(&["--size", "banana"]), "640x480"),
        (with(&["--size", "99999x9"]), "640x480"),
        (with(&["--threads", "0"]), "--threads"),
        (with(&["--time", "nan"]), "seconds"),
        (with(&["--seed", "banana"]), "--seed"),
        (with(&["--light", "7"]), "no light 7"),
        (with(&["--preset", "nonesuch"]), "no preset 'nonesuch'"),
        (with(&["--set", "nonesuch=1"]), "no setting 'nonesuch'"),
        (with(&["--set", "nonesuch"]), "KEY=VALUE"),
        (with(&["--set", "map_size=banana"]), "map_size=banana"),
        (with(&["--set", "map_size=0"]), "map_size=0"),
        (with(&["--backend", "abacus"]), "abacus"),
        (vec!["render", "quads", "--technique", "nonesuch", "--out", "out"], "no technique 'nonesuch'"),
        (vec!["reference", "quads", "--samples", "0", "--out", "out"], "--samples"),
        (vec!["reference", "quads", "--max-error", "0", "--out", "out"], "from 0.001 to 1"),
        (vec!["reference", "quads", "--max-error", "0.1", "--exact", "--out", "out"], "--exact"),
        (vec!["reference", "knot", "--exact", "--size", "8x8", "--out", "out"], "not this sphere light"),
        (vec!["compare", "quads", "--techniques", "nonesuch"], "no technique 'nonesuch'"),
        (vec!["compare", "quads", "--techniques", "shadow-map@nonesuch"], "no preset 'nonesuch'"),
        (vec!["compare", "quads", "--techniques", ","], "nothing to compare"),
        (vec!["compare", "quads", "--error-scale", "0"], "0.001 to 1"),
        (vec!["techniques", "nonesuch"], "no technique 'nonesuch'"),
    ];
    for (arguments, fault) in rows {
        fails(2, &[], arguments, fault);
    }
}

#[test]
fn scenes_that_are_not_there() {
    for (scene, fault) in [
        ("nonesuch", "neither a file nor a built-in scene: built in are cornell"),
        ("nonesuch.obj", "nonesuch.obj"),
        ("no/such/folder/mesh", "no/such/folder/mesh"),
        ("", "''"),
        ("quads:nonesuch=1", "nonesuch"),
        ("quads:squares=banana", "banana"),
        ("quads:squares=1000000", "1000000"),
        ("quads:squares", "squares"),
        (".", "."),
    ] {
        fails(2, &[], &["compare", scene, "--out", "out"], fault);
    }
}

#[test]
fn broken_files() {
    let cube_without_end: &[u8] = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n";
    let rows: &[(&str, &[u8], &str)] = &[
        ("empty.obj", b"", "empty.obj"),
        ("index.obj", cube_without_end, "index.obj"),
        ("nan.obj", b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "nan.obj"),
        ("noise.obj", &[0xff, 0x00, 0x13, 0x37], "noise.obj"),
        ("noise.glb", b"glTF\x02\x00\x00\x00\xff\xff\xff\xff", "noise.glb"),
        ("short.gltf", b"{\"asset\":", "short.gltf"),
        ("short.json", b"{\"meshes\": [", "short.json"),
        ("short.toml", b"meshes = [", "short.toml"),
        ("lost.json", b"{\"meshes\": [\"gone.obj\"]}", "gone.obj"),
        ("unknown.json", b"{\"meshes\": [], \"nonesuch\": 1}", "nonesuch"),
        ("text.txt", b"v 0 0 0\n", "txt"),
    ];
    for (name, bytes, fault) in rows {
        fails(2, &[(name, bytes)], &["render", name, "--technique", "shadow-map", "--out", "out"], fault);
        fails(2, &[(name, bytes)], &["reference", name, "--json", "--out", "a/b"], fault);
        fails(2, &[(name, bytes)], &["compare", name], fault);
    }
}

#[test]
fn time_moves_nothing_in_a_file() {
    let mesh: &[u8] = b"v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n";
    fails(2, &[("mesh.obj", mesh)], &["compare", "mesh.obj", "--time", "1"], "--time");
}

#[test]
fn an_output_folder_that_cannot_be() {
    let command = ["render", "quads", "--technique", "shadow-map", "--size", "8x8", "--out"];
    fails(2, &[("file", b"mine")], &[&command[..], &["file"]].concat(), "file");
    fails(2, &[("file", b"mine")], &[&command[..], &["file/below"]].concat(), "below");
    fails(2, &[], &[&command[..], &[""]].concat(), "--out");
}
