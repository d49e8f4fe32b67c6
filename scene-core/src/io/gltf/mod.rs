//! glTF 2.0, `.gltf` and `.glb`, by the types of the `gltf` crate.
//!
//! - The file's default scene is read (`scene`, else the first); a file without scenes is a library, and all
//!   its nodes without parent are taken.
//! - Triangles, strips and fans, indexed or not, of any component type, sparse or quantised; points and lines
//!   are left out. Buffers and pictures may be files beside this one, data URIs or the binary chunk.
//! - The first perspective camera of the scene and all of its `KHR_lights_punctual` lights are taken over.
//! - `alphaMode: MASK` becomes a cut-out; `BLEND` is taken for solid.
//! - Skins, morph targets and animations are ignored: the mesh stands as it is stored.
//! - Every index and range is checked before it is used. The crate's own validation is not run: it panics on
//!   an index of a POSITION that is out of range, and refuses files that lack what is not needed here.

mod accessor;
mod document;
mod material;
mod nodes;
mod primitive;

use std::collections::HashMap;
use std::path::Path;

use super::parts::MeshFile;
use super::{Limits, LoadError, file};
use crate::TriangleMesh;
use crate::geometry::{Repairs, remove_faulty_faces};
use document::Document;
use material::Cutouts;
use primitive::LeftOut;

/// Reads a glTF file with all that it refers to.
pub(super) fn load(path: &Path, limits: &Limits) -> Result<MeshFile, LoadError> {
    let document = Document::load(path, limits)?;
    let scene = nodes::read(&document)?;
    let mut meshes = Meshes {
        document: &document,
        primitives: HashMap::new(),
        meshes: Vec::new(),
        triangles: 0,
        repairs: Repairs::default(),
        cutouts: Cutouts::default(),
        left_out: LeftOut::default(),
    };
    let mut instances = Vec::new();
    let mut instanced = 0;
    for node in &scene.meshes {
        for mesh in meshes.get(node.mesh, &node.name)? {
            instanced += meshes.meshes[mesh].triangles.len() as u64;
            instances.push((mesh, node.world_from_node));
        }
        if instanced > limits.triangles {
            let (path, what) = (path.to_owned(), "triangles, instances counted");
            return Err(LoadError::TooLarge { path, what, count: instanced, limit: limits.triangles });
        }
    }
    let mut notes = scene.notes;
    notes.extend(meshes.notes());
    Ok(MeshFile {
        instances,
        camera: scene.camera,
        lights: scene.lights,
        repairs: meshes.repairs,
        meshes: meshes.meshes,
        notes,
    })
}

/// The meshes that nodes refer to, each read once.
struct Meshes<'d> {
    document: &'d Document<'d>,
    /// The triangle meshes of a mesh's primitives.
    primitives: HashMap<usize, std::ops::Range<usize>>,
    meshes: Vec<TriangleMesh>,
    triangles: u64,
    repairs: Repairs,
    cutouts: Cutouts,
    left_out: LeftOut,
}

impl Meshes<'_> {
    /// The triangle meshes of mesh `index`, which exists.
    fn get(&mut self, index: usize, node: &str) -> Result<std::ops::Range<usize>, LoadError> {
        if let Some(range) = self.primitives.get(&index) {
            return Ok(range.clone());
        }
        let first = self.meshes.len();
        let json = &self.document.root.meshes[index];
        for (i, primitive) in json.primitives.iter().enumerate() {
            let name = format!("meshes[{index}].primitives[{i}]");
            let read =
                primitive::read(self.document, primitive, &name, &mut self.cutouts, &mut self.left_out)?;
            let Some(mut mesh) = read else { continue };
            self.triangles += mesh.triangles.len() as u64;
            let limit = self.document.limits.triangles;
            if self.triangles > limit {
                let (path, count) = (self.document.path.to_owned(), self.triangles);
                return Err(LoadError::TooLarge { path, what: "triangles", count, limit });
            }
            mesh.name = match (node, &json.name) {
                ("", Some(name)) => name.clone(),
                ("", None) => file::stem(self.document.path),
                (node, _) => node.to_owned(),
            };
            self.repairs.add(remove_faulty_faces(&mut mesh));
            self.meshes.push(mesh);
        }
        let range = first..self.meshes.len();
        self.primitives.insert(index, range.clone());
        Ok(range)
    }

    fn notes(&self) -> Vec<String> {
        let left_out = &self.left_out;
        let mut notes: Vec<_> = [
            (left_out.points_and_lines, "primitives of points or lines throw no shadow and were left out"),
            (left_out.without_positions, "primitives without positions were left out"),
            (left_out.invisible, "primitives are cut out wholly by their material and were left out"),
            (left_out.masks_without_uvs, "primitives have a mask but no texture coordinates: they are solid"),
            (left_out.morph_targets, "primitives have morph targets, which are ignored"),
        ]
        .into_iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, what)| format!("{count} {what}"))
        .collect();
        if self.cutouts.blended {
            notes.push("materials that blend are taken for solid".to_owned());
        }
        notes
    }
}
