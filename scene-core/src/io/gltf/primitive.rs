//! One primitive of a glTF mesh to triangles.

use glam::{Vec2, Vec3};
use gltf::json;
use json::mesh::{Mode, Semantic};
use json::validation::Checked;

use super::accessor::Elements;
use super::document::Document;
use super::material::{Cutout, Cutouts};
use crate::TriangleMesh;
use crate::io::LoadError;

/// What was left out of primitives, counted for the notes.
#[derive(Default)]
pub(super) struct LeftOut {
    pub(super) points_and_lines: usize,
    pub(super) without_positions: usize,
    pub(super) invisible: usize,
    pub(super) masks_without_uvs: usize,
    pub(super) morph_targets: usize,
}

/// Reads a primitive; `name` is its element. `None` if it has no surface.
pub(super) fn read(
    document: &Document<'_>,
    primitive: &json::mesh::Primitive,
    name: &str,
    cutouts: &mut Cutouts,
    left_out: &mut LeftOut,
) -> Result<Option<TriangleMesh>, LoadError> {
    let fault = |message: String| document.fault(name, message);
    let Checked::Valid(mode) = primitive.mode else {
        return Err(fault("mode is not 0 to 6".to_owned()));
    };
    if matches!(mode, Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) {
        left_out.points_and_lines += 1;
        return Ok(None);
    }
    let Some(&positions) = primitive.attributes.get(&Checked::Valid(Semantic::Positions)) else {
        left_out.without_positions += 1;
        return Ok(None);
    };
    left_out.morph_targets += usize::from(primitive.targets.as_ref().is_some_and(|t| !t.is_empty()));
    let positions = Elements::new(document, positions, &format!("{name}.attributes.POSITION"))?;
    if !positions.has_components(3) {
        return Err(document.fault(&positions.name, format!("POSITION of {name} must be a VEC3")));
    }
    let cutout = match primitive.material {
        Some(material) => cutouts.get(document, material, &format!("{name}.material"))?,
        None => Cutout::Solid,
    };
    let mut masked = None;
    match cutout {
        Cutout::Solid => {}
        Cutout::Nothing => {
            left_out.invisible += 1;
            return Ok(None);
        }
        Cutout::Mask { mask, set, mask_from_uv } => {
            match primitive.attributes.get(&Checked::Valid(Semantic::TexCoords(set))) {
                Some(&uvs) => {
                    let uvs = Elements::new(document, uvs, &format!("{name}.attributes.TEXCOORD_{set}"))?;
                    if !uvs.has_components(2) || uvs.count < positions.count {
                        let message = format!("TEXCOORD_{set} of {name} must be a VEC2 for each position");
                        return Err(document.fault(&uvs.name, message));
                    }
                    masked = Some((mask, uvs, mask_from_uv));
                }
                None => left_out.masks_without_uvs += 1,
            }
        }
    }

    let triangles = triangles(document, primitive, mode, positions.count, name)?;
    // Several primitives often share one array of vertices: each takes those it uses, in the order of use.
    const UNUSED: u32 = u32::MAX;
    let mut vertex_of = vec![UNUSED; positions.count];
    let mut mesh = TriangleMesh::default();
    let mut corners = triangles;
    for corner in corners.iter_mut().flatten() {
        let element = *corner as usize;
        let vertex = &mut vertex_of[element];
        if *vertex == UNUSED {
            *vertex = mesh.positions.len() as u32;
            let position = Vec3::from_array(positions.floats(element));
            if !position.is_finite() {
                let message = format!(
                    "element {element} is not finite: ({}, {}, {})",
                    position.x, position.y, position.z
                );
                return Err(document.fault(&positions.name, message));
            }
            mesh.positions.push(position);
            if let Some((_, uvs, mask_from_uv)) = &masked {
                mesh.uvs.push(mask_from_uv.transform_point2(Vec2::from_array(uvs.floats(element))));
            }
        }
        *corner = *vertex;
    }
    mesh.triangles = corners;
    mesh.alpha = masked.map(|(mask, ..)| mask);
    Ok(Some(mesh))
}

/// The primitive's triangles, as elements of its positions.
fn triangles(
    document: &Document<'_>,
    primitive: &json::mesh::Primitive,
    mode: Mode,
    positions: usize,
    name: &str,
) -> Result<Vec<[u32; 3]>, LoadError> {
    let indices = match primitive.indices {
        Some(index) => {
            let elements = Elements::new(document, index, &format!("{name}.indices"))?;
            if !elements.are_indices() {
                let message = format!("indices of {name} must be SCALAR and unsigned");
                return Err(document.fault(elements.name, message));
            }
            let indices = elements.indices();
            if let Some(at) = indices.iter().position(|&i| i as usize >= positions) {
                let message = format!(
                    "index {} at place {at} refers to no position: there are {positions}",
                    indices[at]
                );
                return Err(document.fault(elements.name, message));
            }
            indices
        }
        None if positions >= u32::MAX as usize => {
            return Err(document.fault(name, format!("{positions} positions are too many")));
        }
        None => (0..positions as u32).collect(),
    };
    Ok(match mode {
        Mode::TriangleStrip => indices
            .windows(3)
            .enumerate()
            .map(|(i, t)| if i % 2 == 0 { [t[0], t[1], t[2]] } else { [t[0], t[2], t[1]] })
            .collect(),
        Mode::TriangleFan => indices
            .split_first()
            .map(|(&hub, rim)| rim.windows(2).map(|edge| [edge[0], edge[1], hub]).collect())
            .unwrap_or_default(),
        _ => {
            let (triangles, rest) = indices.as_chunks();
            if !rest.is_empty() {
                let message = format!("{} corners make no whole number of triangles", indices.len());
                return Err(document.fault(name, message));
            }
            triangles.to_vec()
        }
    })
}
