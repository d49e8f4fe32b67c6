//! Wavefront OBJ: polygons by `tobj`, checked line by line before.
//!
//! - `o` and `g` begin a new object; `usemtl` does so where a mask begins, ends or changes.
//! - Triangles and quads are split at once, other polygons by [`triangulate`]; `l` and `p` elements,
//!   normals, colours and free-form surfaces are not read.
//! - Faces may refer to what stands above them, by positive or negative indices.
//! - Of materials only `map_d` is read: a cut-out. The texture's alpha channel is the mask if it has one, its
//!   luminance otherwise; a texel is solid from one half. A missing `.mtl` file or material is a note, since
//!   most files go without; a missing or broken texture of a `map_d` that a face uses is an error, since the
//!   shadow would be another one.
//! - Bytes that are not UTF-8 are replaced in names and comments.

mod fault;
mod material;
mod scan;

use std::cell::RefCell;
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{Affine3A, Vec2, Vec3};

pub use fault::ObjFault;

use super::parts::MeshFile;
use super::{Limits, LoadError, file};
use crate::TriangleMesh;
use crate::geometry::{AlphaMask, Repair, remove_faulty_faces, triangulate};
use material::{Cutout, Material};

/// Reads an OBJ file and the materials it names.
pub(super) fn load(path: &Path, limits: &Limits) -> Result<MeshFile, LoadError> {
    let mut text = file::read(path, limits)?;
    let at_line = |(line, fault)| LoadError::Obj { path: path.to_owned(), line, fault };
    let scan = scan::prepare(&mut text).map_err(at_line)?;
    let library = RefCell::new(Library::new(path, limits));
    let options = tobj::LoadOptions { triangulate: false, single_index: false, ..Default::default() };
    let parsed = tobj::load_obj_buf(&mut &text[..], &options, |name| Ok(library.borrow_mut().load(name)));
    let (models, _) = parsed.map_err(|error| {
        // Indices and counts have been checked, so it is a number that tobj refuses.
        at_line(scan::locate(&text).unwrap_or((1, ObjFault::Statement(error.to_string()))))
    })?;
    let mut library = library.into_inner();
    let within = |element: String, source| LoadError::Within {
        path: path.to_owned(),
        element,
        source: Box::new(source),
    };
    if let Some(error) = library.error {
        return Err(within("mtllib".to_owned(), error));
    }

    let mut loaded = MeshFile { notes: std::mem::take(&mut library.notes), ..Default::default() };
    if scan.replaced_bytes {
        loaded.notes.push("bytes that are not UTF-8 were replaced by '?'".to_owned());
    }
    if scan.polylines > 0 {
        loaded.notes.push(format!("{} polylines throw no shadow and were left out", scan.polylines));
    }
    let mut faces = Faces { text: &text, path, next: 0, repaired: Vec::new() };
    let mut previous_name = String::new();
    for model in models {
        if model.mesh.indices.is_empty() {
            continue;
        }
        let mut mask = None;
        if let Some(id) = model.mesh.material_id {
            let name = format!("usemtl {}", library.materials.get(id).map_or("", |m| &m.name));
            mask = library.mask(id).map_err(|error| within(name, error))?;
        }
        let (mut mesh, masked) = faces.mesh(model.mesh, mask, &mut loaded.notes, &model.name)?;
        // A change of material makes a new model to tobj; it is the same object unless masks differ.
        let same_object = model.name == previous_name && !masked;
        match loaded.meshes.last_mut().filter(|last| same_object && last.alpha.is_none()) {
            Some(last) => last.append(&mesh),
            None => {
                mesh.name =
                    if model.name == "unnamed_object" { file::stem(path) } else { model.name.clone() };
                loaded.meshes.push(mesh);
            }
        }
        previous_name = model.name;
    }
    loaded.notes.extend(faces.notes());
    for mesh in &mut loaded.meshes {
        loaded.repairs.add(remove_faulty_faces(mesh));
    }
    loaded.instances = (0..loaded.meshes.len()).map(|i| (i, Affine3A::IDENTITY)).collect();
    Ok(loaded)
}

/// The MTL files that an OBJ file names.
struct Library<'a> {
    obj: &'a Path,
    limits: &'a Limits,
    read: HashSet<PathBuf>,
    materials: Vec<Material>,
    masks: HashMap<usize, Option<Arc<AlphaMask>>>,
    notes: Vec<String>,
    error: Option<LoadError>,
}

impl<'a> Library<'a> {
    fn new(obj: &'a Path, limits: &'a Limits) -> Self {
        Self {
            obj,
            limits,
            read: HashSet::new(),
            materials: Vec::new(),
            masks: HashMap::new(),
            notes: Vec::new(),
            error: None,
        }
    }

    /// Loads what an `mtllib` statement names: a file with blanks in its name, or several files. What it
    /// returns has the materials in the order in which `tobj` numbers them.
    fn load(&mut self, names: &Path) -> (Vec<tobj::Material>, HashMap<String, usize>) {
        let names = names.to_string_lossy().replace('\\', "/");
        let folder = self.obj.parent().unwrap_or(Path::new(""));
        let whole = folder.join(&names);
        let paths = if whole.is_file() {
            vec![whole]
        } else {
            names.split_whitespace().map(|name| folder.join(name)).collect()
        };
        let first = self.materials.len();
        for path in paths {
            // Once is enough, however often it is named.
            if !self.read.insert(path.canonicalize().unwrap_or_else(|_| path.clone())) {
                continue;
            }
            match material::load(&path, self.limits) {
                Ok(materials) => self.materials.extend(materials),
                Err(LoadError::Read { path, source }) => {
                    let why = LoadError::Read { path, source };
                    self.notes.push(format!("materials were not read, so nothing is cut out ({why})"));
                }
                Err(error) => self.error = self.error.take().or(Some(error)),
            }
        }
        let new = &self.materials[first..];
        let ids = new.iter().enumerate().map(|(i, m)| (m.name.clone(), i)).collect();
        (new.iter().map(|m| tobj::Material { name: m.name.clone(), ..Default::default() }).collect(), ids)
    }

    /// The cut-out of a material, read when the first face needs it.
    fn mask(&mut self, id: usize) -> Result<Option<MaskInUse>, LoadError> {
        let Some(cutout) = self.materials.get(id).and_then(|material| material.cutout.as_ref()) else {
            return Ok(None);
        };
        let mask = match self.masks.get(&id) {
            Some(mask) => mask.clone(),
            None => {
                let mask = cutout.mask(self.limits)?.map(Arc::new);
                self.masks.insert(id, mask.clone());
                mask
            }
        };
        Ok(mask.map(|mask| (mask, cutout.clone())))
    }
}

/// A cut-out that is in use: the mask, and how texture coordinates reach it.
type MaskInUse = (Arc<AlphaMask>, Cutout);

/// Turns the faces of models into triangles, in the order of the file.
struct Faces<'a> {
    text: &'a [u8],
    path: &'a Path,
    /// The next face of the file, from 0.
    next: usize,
    /// Faces that were mended, by kind: how often, and the first.
    repaired: Vec<(Repair, usize, usize)>,
}

impl Faces<'_> {
    /// The mesh of a model, and whether it has a mask.
    fn mesh(
        &mut self,
        model: tobj::Mesh,
        mask: Option<MaskInUse>,
        notes: &mut Vec<String>,
        object: &str,
    ) -> Result<(TriangleMesh, bool), LoadError> {
        let fault = |(line, fault)| LoadError::Obj { path: self.path.to_owned(), line, fault };
        let mut positions: Vec<Vec3> =
            model.positions.as_chunks().0.iter().copied().map(Vec3::from_array).collect();
        if positions.iter().any(|p| !p.is_finite()) {
            let unlocated = || (1, ObjFault::NotFinite("a coordinate".to_owned()));
            return Err(fault(scan::locate(self.text).unwrap_or_else(unlocated)));
        }
        let mut indices = model.indices;
        let (mut uvs, mut alpha) = (Vec::new(), None);
        if let Some((mask, cutout)) = mask {
            if model.texcoord_indices.len() == indices.len() {
                split_by_texcoord(&mut positions, &mut uvs, &mut indices, &model.texcoord_indices, |i| {
                    let i = 2 * i as usize;
                    cutout.mask_uv(Vec2::new(model.texcoords[i], model.texcoords[i + 1]))
                });
                alpha = Some(mask);
            } else {
                notes.push(format!("object '{object}' has a mask but no texture coordinates: it is solid"));
            }
        }
        let triangles = self.triangles(&positions, &indices, &model.face_arities)?;
        let masked = alpha.is_some();
        Ok((TriangleMesh { name: String::new(), positions, triangles, uvs, alpha }, masked))
    }

    fn triangles(
        &mut self,
        positions: &[Vec3],
        indices: &[u32],
        arities: &[u32],
    ) -> Result<Vec<[u32; 3]>, LoadError> {
        if arities.is_empty() {
            self.next += indices.len() / 3;
            return Ok(indices.as_chunks().0.to_vec());
        }
        let mut triangles = Vec::with_capacity(indices.len().saturating_sub(2 * arities.len()));
        let (mut corners, mut local) = (Vec::new(), Vec::new());
        let mut rest = indices;
        for &arity in arities {
            let (face, others) = rest.split_at(arity as usize);
            rest = others;
            if let [a, b, c] = *face {
                triangles.push([a, b, c]);
            } else {
                corners.clear();
                corners.extend(face.iter().map(|&i| positions[i as usize]));
                local.clear();
                match triangulate(&corners, &mut local) {
                    Ok(None) => {}
                    Ok(Some(repair)) => self.note_repair(repair),
                    Err(fault) => {
                        let line = scan::line_of_face(self.text, self.next);
                        return Err(LoadError::Obj { path: self.path.to_owned(), line, fault: fault.into() });
                    }
                }
                triangles.extend(local.iter().map(|t| t.map(|i| face[i as usize])));
            }
            self.next += 1;
        }
        Ok(triangles)
    }

    fn note_repair(&mut self, repair: Repair) {
        match self.repaired.iter_mut().find(|(kind, ..)| *kind == repair) {
            Some((_, count, _)) => *count += 1,
            None => self.repaired.push((repair, 1, self.next)),
        }
    }

    fn notes(&self) -> Vec<String> {
        let note = |&(repair, count, first): &(Repair, usize, usize)| {
            let line = scan::line_of_face(self.text, first);
            let what = match repair {
                Repair::NoArea => "polygons without area were dropped",
                Repair::Folded => "quads that are folded or cross themselves were split along a diagonal",
                Repair::Crossing => "polygons that cross themselves were mended as well as may be",
                Repair::Overlap => {
                    "polygons that cover a part of themselves twice were made to cover it once"
                }
            };
            format!("{count} {what} (the first at line {line})")
        };
        self.repaired.iter().map(note).collect()
    }
}

/// Gives every pair of position and texture coordinate a vertex of its own.
fn split_by_texcoord(
    positions: &mut Vec<Vec3>,
    uvs: &mut Vec<Vec2>,
    indices: &mut [u32],
    texcoord_indices: &[u32],
    uv: impl Fn(u32) -> Vec2,
) {
    let mut vertices = HashMap::new();
    let mut split = Vec::new();
    for (index, &texcoord) in indices.iter_mut().zip(texcoord_indices) {
        let position = *index;
        *index = *vertices.entry((position, texcoord)).or_insert_with(|| {
            split.push(positions[position as usize]);
            uvs.push(uv(texcoord));
            split.len() as u32 - 1
        });
    }
    *positions = split;
}
