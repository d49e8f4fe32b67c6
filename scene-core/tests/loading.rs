//! What sound files become: polygons, groups, masks, transforms, cameras, lights, and the rule for bare meshes.

use std::fs;
use std::path::PathBuf;

use glam::{Vec2, Vec3};
use gnomon_scene_core::geometry::Aabb;
use gnomon_scene_core::io::{LoadOptions, UpAxis, load_setup, load_setup_with};
use gnomon_scene_core::{Light, SceneSetup};

/// A folder of files that goes away with it.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn write(&self, name: &str, contents: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.path().join(name);
        fs::write(&path, contents).unwrap();
        path
    }

    fn load(&self, name: &str, contents: impl AsRef<[u8]>) -> SceneSetup {
        load_setup(&self.write(name, contents)).unwrap()
    }
}

/// Objects but for the ground of the rule.
fn triangles_of(setup: &SceneSetup) -> Vec<(String, usize)> {
    let objects = setup.scene.objects().iter().filter(|o| o.name != "ground");
    objects.map(|o| (o.name.clone(), o.triangles.len())).collect()
}

/// The area of an object.
fn area(setup: &SceneSetup, object: usize) -> f32 {
    let triangles = setup.scene.objects()[object].triangles.clone();
    triangles.map(|t| setup.scene.corners(t)).map(|[a, b, c]| (b - a).cross(c - a).length() * 0.5).sum()
}

fn has_note(setup: &SceneSetup, words: &str) -> bool {
    setup.notes.iter().any(|note| note.contains(words))
}

#[test]
fn obj_groups_become_objects_and_polygons_triangles() {
    let setup = Folder::new().load(
        "m.obj",
        "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 0 4 0\nv 2 1 0\n\
         o quad\nf 1 2 3 4\ng arrow\nusemtl red\nf 1 5 2 3 4\nusemtl blue\nf -5 -4 -3\n\
         o repaired\nf 1 2 3\nf 2 3 1\nf 1 2 2\nf 3 2 1\n",
    );
    let expected = [("quad", 2), ("arrow", 4), ("repaired", 2)].map(|(n, t)| (n.to_owned(), t));
    assert_eq!(triangles_of(&setup), expected);
    assert_eq!((area(&setup, 0), area(&setup, 1)), (16.0, 14.0 + 8.0));
    assert!(
        has_note(&setup, "m.obj: removed 1 triangle without area and 1 triangle that repeat"),
        "{:?}",
        setup.notes
    );
}

#[test]
fn obj_masks_flip_v_and_belong_to_their_faces() {
    let folder = Folder::new();
    // Solid above, cut out below.
    image::GrayImage::from_fn(1, 2, |_, y| image::Luma([if y == 0 { 255 } else { 0 }]))
        .save(folder.0.path().join("half.png"))
        .unwrap();
    folder.write("m.mtl", "newmtl solid\nKd 1 0 0\nnewmtl leaf\nmap_d half.png\n");
    let setup = folder.load(
        "m.obj",
        "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
         o tree\nusemtl solid\nf 1/1 2/2 3/3\nusemtl leaf\nf 1/1 2/2 3/3 4/4\nusemtl missing\nf 1/1 3/3 4/4\n",
    );
    let objects = setup.scene.objects();
    let masks: Vec<_> = objects.iter().map(|o| o.alpha.is_some()).collect();
    assert_eq!(masks, [false, true, false, false], "solid, leaf, missing, ground");
    let mask = objects[1].alpha.as_ref().unwrap();
    for vertex in objects[1].vertices.clone() {
        // The upper edge of the square has v = 1 in the file: the picture's top, which is solid.
        let (y, uv) = (setup.scene.positions()[vertex].y, setup.scene.uvs()[vertex]);
        assert_eq!(uv.y, 1.0 - y);
        assert_eq!(mask.is_solid(Vec2::new(0.5, uv.y.clamp(0.1, 0.9))), y == 1.0);
    }
}

#[test]
fn a_missing_material_file_is_a_note() {
    let setup = Folder::new().load("m.obj", "mtllib no.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n");
    assert!(has_note(&setup, "no.mtl: there is no such file"), "{:?}", setup.notes);
}

/// A glTF document with one buffer of floats, and `rest`.
fn gltf(values: &[f32], rest: &str) -> String {
    gltf_of_bytes(&values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<_>>(), rest)
}

/// A glTF document with one buffer, and `rest`.
fn gltf_of_bytes(bytes: &[u8], rest: &str) -> String {
    use base64::Engine;
    let data = base64::engine::general_purpose::STANDARD.encode(bytes);
    format!(
        r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":{},"uri":"data:application/octet-stream;base64,{data}"}}],{rest}}}"#,
        bytes.len()
    )
}

/// A unit square in the xy plane, as a strip.
const SQUARE: [f32; 12] = [0., 0., 0., 1., 0., 0., 0., 1., 0., 1., 1., 0.];
const SQUARE_VIEW: &str = r#""bufferViews":[{"buffer":0,"byteLength":48}],
    "accessors":[{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"}]"#;

#[test]
fn gltf_starts_from_its_scene_and_applies_transforms() {
    // Node 1 moves by (10, 0, 0), then its child scales by 2; node 0 is a parent that the scene leaves out.
    let setup = Folder::new().load(
        "m.gltf",
        gltf(
            &SQUARE,
            &format!(
                r#"{SQUARE_VIEW},"scene":1,"scenes":[{{"nodes":[0]}},{{"nodes":[1]}}],
                "nodes":[{{"children":[1],"translation":[0,0,99]}},{{"children":[2,3],"translation":[10,0,0]}},
                  {{"mesh":0,"scale":[2,2,2],"name":"big"}},
                  {{"mesh":0,"rotation":[0,0.70710678,0,0.70710678]}}],
                "meshes":[{{"name":"square","primitives":[{{"attributes":{{"POSITION":0}},"mode":5}}]}}]"#
            ),
        ),
    );
    let bounds: Vec<_> = setup.scene.objects().iter().map(|o| o.bounds).collect();
    assert_eq!(bounds[0], Aabb { min: Vec3::new(10.0, 0.0, 0.0), max: Vec3::new(12.0, 2.0, 0.0) });
    // x turns to −z about y.
    assert!((bounds[1].min - Vec3::new(10.0, 0.0, -1.0)).length() < 1e-6, "{:?}", bounds[1]);
    assert!((bounds[1].max - Vec3::new(10.0, 1.0, 0.0)).length() < 1e-6);
    assert_eq!((area(&setup, 0), triangles_of(&setup)[0].1), (4.0, 2));
}

#[test]
fn gltf_strips_keep_their_winding_and_fans_are_read() {
    let mode = |mode: u32, corners: &[f32]| {
        let rest = format!(
            r#"{SQUARE_VIEW},"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],
            "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"mode":{mode}}}]}}]"#
        );
        Folder::new().load("m.gltf", gltf(corners, &rest))
    };
    let fan = [0., 0., 0., 1., 0., 0., 1., 1., 0., 0., 1., 0.];
    for setup in [mode(5, &SQUARE), mode(6, &fan)] {
        assert_eq!(area(&setup, 0), 1.0);
        for triangle in setup.scene.objects()[0].triangles.clone() {
            let [a, b, c] = setup.scene.corners(triangle);
            assert!((b - a).cross(c - a).z > 0.0, "every triangle faces +z");
        }
    }
}

#[test]
fn gltf_reads_sparse_and_strided_accessors() {
    let strided = [[0f32, 0., 0., 7.], [1., 0., 0., 7.], [0., 1., 0., 7.]];
    let mut bytes: Vec<u8> = strided.as_flattened().iter().flat_map(|v| v.to_le_bytes()).collect();
    bytes.extend([0, 1, 2, 99]); // indices of one byte
    bytes.extend(2u32.to_le_bytes()); // element 2 …
    bytes.extend([0f32, 5., 0.].iter().flat_map(|v| v.to_le_bytes())); // … becomes (0, 5, 0)
    let rest = r#""bufferViews":[{"buffer":0,"byteLength":48,"byteStride":16},{"buffer":0,"byteOffset":48,"byteLength":4},
        {"buffer":0,"byteOffset":52,"byteLength":4},{"buffer":0,"byteOffset":56,"byteLength":12}],
        "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","sparse":{"count":1,
          "indices":{"bufferView":2,"componentType":5125},"values":{"bufferView":3}}},
          {"bufferView":1,"componentType":5121,"count":3,"type":"SCALAR"}],
        "scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}]"#;
    let setup = Folder::new().load("m.gltf", gltf_of_bytes(&bytes, rest));
    assert_eq!(setup.scene.corners(0), [Vec3::ZERO, Vec3::X, Vec3::new(0.0, 5.0, 0.0)]);
}

#[test]
fn gltf_reads_quantised_positions() {
    let shorts: [i16; 12] = [0, 0, 0, 0, 32_767, 0, 0, 0, 0, -32_768, 0, 0];
    let bytes: Vec<u8> = shorts.iter().flat_map(|v| v.to_le_bytes()).collect();
    let rest = r#""extensionsRequired":["KHR_mesh_quantization"],
        "bufferViews":[{"buffer":0,"byteLength":24,"byteStride":8}],
        "accessors":[{"bufferView":0,"componentType":5122,"normalized":true,"count":3,"type":"VEC3"}],
        "scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}]"#;
    let setup = Folder::new().load("m.gltf", gltf_of_bytes(&bytes, rest));
    assert_eq!(setup.scene.corners(0), [Vec3::ZERO, Vec3::X, Vec3::NEG_Y]);
}

#[test]
fn gltf_cameras_and_lights_are_taken_over() {
    let setup = Folder::new().load(
        "m.gltf",
        gltf(
            &SQUARE,
            &format!(
                r#"{SQUARE_VIEW},"scenes":[{{"nodes":[0,1,2,3]}}],
                "nodes":[{{"mesh":0}},{{"camera":0,"translation":[0,0,5]}},
                  {{"rotation":[-0.70710678,0,0,0.70710678],"translation":[0,3,0],"extensions":{{"KHR_lights_punctual":{{"light":0}}}}}},
                  {{"rotation":[-0.70710678,0,0,0.70710678],"extensions":{{"KHR_lights_punctual":{{"light":1}}}}}}],
                "cameras":[{{"type":"perspective","perspective":{{"yfov":0.5,"znear":0.1,"aspectRatio":2}}}}],
                "extensions":{{"KHR_lights_punctual":{{"lights":[{{"type":"spot","spot":{{"innerConeAngle":0.1,"outerConeAngle":0.3}}}},{{"type":"directional"}}]}}}},
                "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"mode":5}}]}}]"#
            ),
        ),
    );
    let camera = setup.camera;
    assert_eq!((camera.eye, camera.width, camera.height), (Vec3::new(0.0, 0.0, 5.0), 1024, 512));
    assert_eq!((camera.near, camera.far, camera.fov_y), (0.1, f32::INFINITY, 0.5));
    assert!((camera.forward() - Vec3::NEG_Z).length() < 1e-6);
    assert_eq!(setup.scene.objects().len(), 1, "no ground is added to a composed scene");
    let [Light::Spot { position, direction, outer, inner }, Light::Directional { direction: sun, .. }] =
        setup.lights[..]
    else {
        panic!("{:?}", setup.lights)
    };
    assert_eq!((position, outer, inner), (Vec3::new(0.0, 3.0, 0.0), 0.3, 0.1));
    assert!((direction - Vec3::NEG_Y).length() < 1e-6 && (sun - Vec3::NEG_Y).length() < 1e-6);
}

#[test]
fn gltf_masks_follow_alpha_cutoff_and_texture_transform() {
    let folder = Folder::new();
    // Alpha 200 on the left, 100 on the right.
    image::RgbaImage::from_fn(2, 1, |x, _| image::Rgba([0, 0, 0, if x == 0 { 200 } else { 100 }]))
        .save(folder.0.path().join("a b.png"))
        .unwrap();
    let load = |material: &str| {
        let mut values = SQUARE.to_vec();
        values.extend([0., 0., 1., 0., 0., 1., 1., 1.]);
        let rest = format!(
            r#""bufferViews":[{{"buffer":0,"byteLength":48}},{{"buffer":0,"byteOffset":48,"byteLength":32}}],
            "accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"}},
              {{"bufferView":1,"componentType":5126,"count":4,"type":"VEC2"}}],
            "scenes":[{{"nodes":[0,1]}}],"nodes":[{{"mesh":0}},{{"mesh":1,"translation":[3,0,0]}}],
            "textures":[{{"source":0,"sampler":0}}],"samplers":[{{"wrapS":33071}}],"images":[{{"uri":"a%20b.png"}}],
            "materials":[{material}],
            "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"TEXCOORD_0":1}},"material":0,"mode":5}}]}},
              {{"primitives":[{{"attributes":{{"POSITION":0}},"mode":5}}]}}]"#
        );
        folder.load("m.gltf", gltf(&values, &rest))
    };
    let texture = r#""baseColorTexture":{"index":0}"#;
    let mask = |setup: &SceneSetup| setup.scene.objects()[0].alpha.clone().map(|m| m.texels().to_vec());
    let half = load(&format!(r#"{{"alphaMode":"MASK","pbrMetallicRoughness":{{{texture}}}}}"#));
    assert_eq!(mask(&half), Some(vec![true, false]));
    // All is solid: no mask is left.
    let low =
        load(&format!(r#"{{"alphaMode":"MASK","alphaCutoff":0.3,"pbrMetallicRoughness":{{{texture}}}}}"#));
    assert_eq!(mask(&low), None);
    // A factor of 0.5 pushes all below the cut-off: the square is gone, the other stays.
    let faint = load(&format!(
        r#"{{"alphaMode":"MASK","pbrMetallicRoughness":{{{texture},"baseColorFactor":[1,1,1,0.5]}}}}"#
    ));
    assert_eq!(triangles_of(&faint).len(), 1);
    assert!(has_note(&faint, "cut out wholly"), "{:?}", faint.notes);
    let opaque = load(&format!(r#"{{"pbrMetallicRoughness":{{{texture}}}}}"#));
    assert_eq!(mask(&opaque), None);
    let moved = load(
        r#"{"alphaMode":"MASK","pbrMetallicRoughness":{"baseColorTexture":{"index":0,
           "extensions":{"KHR_texture_transform":{"offset":[0.5,0.25],"scale":[2,3]}}}}}"#,
    );
    let uvs: Vec<_> = moved.scene.objects()[0].vertices.clone().map(|v| moved.scene.uvs()[v]).collect();
    assert!(uvs.contains(&Vec2::new(0.5, 0.25)) && uvs.contains(&Vec2::new(2.5, 3.25)), "{uvs:?}");
}

#[test]
fn scene_files_place_meshes_and_set_flags() {
    let folder = Folder::new();
    folder.write("t.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let toml = "name = \"two\"\nmeshes = [\"t.obj\", { file = \"t.obj\", translate = [0, 0, 5], scale = [2, 2, 1], rotate = [0, 0, 90], casts = false, dynamic = true }]\n\
        [camera]\neye = [0, 0, 9]\ntarget = [0, 0, 0]\nwidth = 64\nheight = 32\n[light]\nkind = \"disk\"\ncenter = [0, 9, 0]\nnormal = [0, 1, 0]\nradius = 2\n";
    let from_toml = folder.load("s.toml", toml);
    let json = r#"{"name":"two","meshes":["t.obj",{"file":"t.obj","translate":[0,0,5],"scale":[2,2,1],"rotate":[0,0,90],"casts":false,"dynamic":true}],
        "camera":{"eye":[0,0,9],"target":[0,0,0],"width":64,"height":32},
        "light":{"kind":"disk","center":[0,9,0],"normal":[0,1,0],"radius":2}}"#;
    let from_json = folder.load("s.json", json);
    for setup in [from_toml, from_json] {
        assert_eq!((setup.name.as_str(), setup.notes.len()), ("two", 0));
        let [first, second] = setup.scene.objects() else { panic!("no ground is wanted") };
        assert!(first.flags.casts && first.flags.receives && !first.flags.dynamic);
        assert!(!second.flags.casts && second.flags.receives && second.flags.dynamic);
        let corners = setup.scene.corners(1);
        assert!((corners[1] - Vec3::new(0.0, 2.0, 5.0)).length() < 1e-5, "{corners:?}");
        assert!((corners[2] - Vec3::new(-2.0, 0.0, 5.0)).length() < 1e-5, "{corners:?}");
        assert_eq!((setup.camera.width, setup.camera.far), (64, f32::INFINITY));
        assert!((setup.camera.near - 0.09).abs() < 1e-6);
        assert_eq!(setup.lights, [Light::Disk { center: Vec3::Y * 9.0, normal: Vec3::Y, radius: 2.0 }]);
    }
}

#[test]
fn what_a_scene_file_lacks_is_chosen() {
    let folder = Folder::new();
    folder.write("t.obj", "v 0 0 0\nv 1 0 0\nv 0 0 1\nv 0 1 0\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n");
    let bare = folder.load("bare.toml", "meshes = [\"t.obj\"]\n");
    assert_eq!((bare.name.as_str(), bare.lights.len(), bare.scene.objects().len()), ("bare", 1, 2));
    let seen = folder.load("seen.toml", "meshes = [\"t.obj\"]\n[camera]\neye = [3, 3, 3]\n");
    assert_eq!((seen.camera.target, seen.lights.len(), seen.scene.objects().len()), (Vec3::splat(0.5), 1, 1));
    let up = folder.load("up.toml", "meshes = [\"t.obj\"]\n[camera]\nup = [0, 0, 1]\nfov_y_deg = 60\n");
    assert!(up.camera.eye.z > 1.0 && up.camera.up == Vec3::Z && up.camera.validate().is_ok());
}

/// A box from `min` to `max`, as an OBJ file.
fn box_obj(min: Vec3, max: Vec3) -> String {
    let corner = |i: usize| {
        let pick = |bit: usize, low: f32, high: f32| if i >> bit & 1 == 1 { high } else { low };
        Vec3::new(pick(0, min.x, max.x), pick(1, min.y, max.y), pick(2, min.z, max.z))
    };
    let vertices: String = (0..8).map(corner).map(|p| format!("v {} {} {}\n", p.x, p.y, p.z)).collect();
    vertices + "f 1 2 4 3\nf 5 6 8 7\nf 1 2 6 5\nf 3 4 8 7\nf 1 3 7 5\nf 2 4 8 6\n"
}

/// The rule holds: the box and its shadow are in the picture, the light is outside and above, the shadow
/// falls on the ground.
fn assert_framed(setup: &SceneSetup, up: Vec3) {
    assert_eq!(setup.camera.validate(), Ok(()));
    let [object, ground] = setup.scene.objects() else { panic!("a box and a ground") };
    assert!(!ground.flags.casts && ground.flags.receives);
    let [Light::Rect { center, half_u, half_v }] = setup.lights[..] else { panic!("{:?}", setup.lights) };
    let diagonal = object.bounds.diagonal();
    let ground_height = ground.bounds.center().dot(up);
    let lowest = object.bounds.corners().iter().map(|c| c.dot(up)).fold(f32::INFINITY, f32::min);
    assert!(ground_height < lowest && lowest - ground_height < 0.03 * diagonal, "{ground_height} {lowest}");
    let in_picture = |point: Vec3| {
        let clip = setup.camera.projection_from_world() * point.extend(1.0);
        clip.w > setup.camera.near && (clip.truncate() / clip.w).truncate().abs().max_element() < 0.95
    };
    for corner in object.bounds.corners() {
        assert!(in_picture(corner), "{corner} is outside the picture");
        for light in [center, center + half_u + half_v, center - half_u + half_v, center - half_u - half_v] {
            assert!((light - corner).dot(up) > 0.0, "the light is above");
            let along = (light.dot(up) - ground_height) / (light - corner).dot(up);
            let shadow = light + (corner - light) * along;
            assert!(light != center || in_picture(shadow), "the shadow at {shadow} is outside the picture");
            let wide = ground.bounds;
            let slack = Vec3::splat(1e-3 * diagonal);
            let on_ground = (shadow + slack).cmpge(wide.min).all() && (shadow - slack).cmple(wide.max).all();
            assert!(on_ground, "the shadow at {shadow} is beside the ground");
        }
    }
    // The picture is used: the box alone covers a fair part of it.
    let projected = object.bounds.corners().map(|p| {
        let clip = setup.camera.projection_from_world() * p.extend(1.0);
        (clip.truncate() / clip.w).with_z(0.0)
    });
    assert!(Aabb::from_points(projected).size().max_element() > 0.5, "the box is small in the picture");
}

#[test]
fn a_bare_mesh_is_framed_at_any_scale_place_and_shape() {
    let folder = Folder::new();
    for scale in [1e-3f32, 1.0, 1e4] {
        for shape in [Vec3::ONE, Vec3::new(5.0, 0.2, 5.0), Vec3::new(0.2, 5.0, 0.2), Vec3::new(9.0, 1.0, 1.0)]
        {
            for place in [Vec3::ZERO, Vec3::new(300.0, -200.0, 100.0)] {
                let min = (place - shape * 0.5) * scale;
                let setup = folder.load("b.obj", box_obj(min, min + shape * scale));
                assert_framed(&setup, Vec3::Y);
            }
        }
    }
    let flat = folder.load("flat.obj", "v 0 0 0\nv 1 0 0\nv 1 0 1\nv 0 0 1\nf 1 2 3 4\n");
    assert_framed(&flat, Vec3::Y);
}

#[test]
fn a_bare_mesh_is_framed_with_any_axis_up() {
    let folder = Folder::new();
    let path = folder.write("b.obj", box_obj(Vec3::ZERO, Vec3::new(1.0, 2.0, 3.0)));
    for (up, axis) in [(UpAxis::X, Vec3::X), (UpAxis::Y, Vec3::Y), (UpAxis::Z, Vec3::Z)] {
        let setup = load_setup_with(&path, &LoadOptions { up, ..Default::default() }).unwrap();
        assert_framed(&setup, axis);
        assert!(has_note(&setup, &format!("+{} up", format!("{up:?}").to_lowercase())));
    }
}

#[test]
fn progress_names_every_mesh_once() {
    let folder = Folder::new();
    folder.write("a.obj", box_obj(Vec3::ZERO, Vec3::ONE));
    folder.write("b.obj", box_obj(Vec3::ZERO, Vec3::ONE));
    let path = folder.write("s.toml", "meshes = [\"a.obj\", \"b.obj\", \"a.obj\"]\n");
    let seen = std::sync::Mutex::new(Vec::new());
    let record = |p: gnomon_scene_core::io::Progress<'_>| {
        seen.lock().unwrap().push((p.path.file_name().unwrap().to_owned(), p.done, p.total));
    };
    load_setup_with(&path, &LoadOptions { progress: Some(&record), ..Default::default() }).unwrap();
    assert_eq!(*seen.lock().unwrap(), [("a.obj".into(), 0, 3), ("b.obj".into(), 1, 3)]);
}

#[test]
fn planar_receivers_are_marked_by_name() {
    let folder = Folder::new();
    folder.write("m.obj", "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 0 4 0\no wall\nf 1 2 3 4\no post\nf 1 2 3\n");
    let marked = |contents: &str| {
        let setup = folder.load("scene.toml", contents);
        let planar = setup.scene.objects().iter().filter(|o| o.flags.planar);
        planar.map(|o| o.name.clone()).collect::<Vec<_>>()
    };
    assert!(marked("meshes = ['m.obj']").is_empty());
    // The ground that a bare scene gets has a name too.
    assert_eq!(marked("meshes = ['m.obj']\nplanar_receivers = ['wall', 'ground']"), ["wall", "ground"]);
    assert_eq!(marked("meshes = ['m.obj', 'm.obj']\nplanar_receivers = ['post']"), ["post", "post"]);
}
