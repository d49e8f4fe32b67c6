//! The nodes of a glTF scene: places of meshes, the camera, the lights.

use glam::{Affine3A, DAffine3, DMat4, DQuat, DVec3, Vec3};
use gltf::json;
use json::camera::Type as Projection;
use json::extensions::scene::khr_lights_punctual::Type as LightKind;
use json::validation::Checked;

use super::document::Document;
use crate::io::LoadError;
use crate::io::framing::DEFAULT_SIDE;
use crate::{Camera, Light};

/// A node that has a mesh.
pub(super) struct MeshNode {
    /// The node's name; may be empty.
    pub(super) name: String,
    /// Index of a mesh that exists.
    pub(super) mesh: usize,
    pub(super) world_from_node: Affine3A,
}

/// What the nodes of a scene hold.
#[derive(Default)]
pub(super) struct NodeScene {
    pub(super) meshes: Vec<MeshNode>,
    pub(super) camera: Option<Camera>,
    pub(super) lights: Vec<Light>,
    pub(super) notes: Vec<String>,
}

/// Visits every node of the file's scene once.
pub(super) fn read(document: &Document<'_>) -> Result<NodeScene, LoadError> {
    let root = &document.root;
    let mut scene = NodeScene::default();
    let mut to_visit: Vec<(json::Index<json::Node>, String, DAffine3)> = Vec::new();
    for (index, from) in top_nodes(document, &mut scene.notes)?.into_iter().rev() {
        to_visit.push((index, from, DAffine3::IDENTITY));
    }
    let mut visited = vec![false; root.nodes.len()];
    let (mut more_cameras, mut orthographic, mut skinned) = (0, 0, 0);
    while let Some((index, from, world_from_parent)) = to_visit.pop() {
        let node = document.get(&root.nodes, index, "nodes", &from)?;
        let name = format!("nodes[{}]", index.value());
        if std::mem::replace(&mut visited[index.value()], true) {
            let message =
                format!("{from} leads here again: a node has one parent, and is not its own ancestor");
            return Err(document.fault(name, message));
        }
        let world_from_node = world_from_parent * local_transform(document, node, &name)?;
        if let Some(mesh) = node.mesh {
            document.get(&root.meshes, mesh, "meshes", &format!("{name}.mesh"))?;
            skinned += usize::from(node.skin.is_some());
            scene.meshes.push(MeshNode {
                name: node.name.clone().unwrap_or_default(),
                mesh: mesh.value(),
                world_from_node: single_precision(world_from_node),
            });
        }
        if let Some(index) = node.camera {
            match camera(document, index, &format!("{name}.camera"), world_from_node)? {
                None => orthographic += 1,
                Some(_) if scene.camera.is_some() => more_cameras += 1,
                Some(camera) => scene.camera = Some(camera),
            }
        }
        let punctual = node.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref());
        if let Some(punctual) = punctual {
            scene.lights.push(light(document, punctual.light, &name, world_from_node)?);
        }
        let children = node.children.as_deref().unwrap_or_default();
        to_visit.extend(
            children
                .iter()
                .enumerate()
                .rev()
                .map(|(i, &child)| (child, format!("{name}.children[{i}]"), world_from_node)),
        );
    }
    for (count, what) in [
        (more_cameras, "more cameras are not used: the first one is"),
        (orthographic, "orthographic cameras are not used: only perspective ones are"),
        (skinned, "meshes have a skin, which is ignored: they stand as they are stored"),
    ] {
        if count > 0 {
            scene.notes.push(format!("{count} {what}"));
        }
    }
    Ok(scene)
}

/// The nodes to start from, and what refers to each.
fn top_nodes(
    document: &Document<'_>,
    notes: &mut Vec<String>,
) -> Result<Vec<(json::Index<json::Node>, String)>, LoadError> {
    let root = &document.root;
    let index = match root.scene {
        Some(index) => index,
        None if !root.scenes.is_empty() => json::Index::new(0),
        None => {
            if !root.nodes.is_empty() {
                notes.push("there is no scene in it: all nodes without parent were taken".to_owned());
            }
            let mut has_parent = vec![false; root.nodes.len()];
            for child in root.nodes.iter().flat_map(|node| node.children.iter().flatten()) {
                if let Some(child) = has_parent.get_mut(child.value()) {
                    *child = true;
                }
            }
            let parentless = (0u32..).zip(has_parent).filter(|(_, has_parent)| !has_parent);
            return Ok(parentless.map(|(i, _)| (json::Index::new(i), "nodes".to_owned())).collect());
        }
    };
    let scene = document.get(&root.scenes, index, "scenes", "scene")?;
    let from = |i: usize| format!("scenes[{}].nodes[{i}]", index.value());
    Ok(scene.nodes.iter().enumerate().map(|(i, &node)| (node, from(i))).collect())
}

/// A node's place in its parent, in f64, so that a deep tree rounds once.
fn local_transform(document: &Document<'_>, node: &json::Node, name: &str) -> Result<DAffine3, LoadError> {
    let transform = if let Some(matrix) = node.matrix {
        DAffine3::from_mat4(DMat4::from_cols_array(&matrix.map(f64::from)))
    } else {
        let rotation = node.rotation.map_or(DQuat::IDENTITY, |r| DQuat::from_array(r.0.map(f64::from)));
        if rotation.length_squared() == 0.0 {
            return Err(document.fault(name, "its rotation has no length"));
        }
        DAffine3::from_scale_rotation_translation(
            node.scale.map_or(DVec3::ONE, |s| DVec3::from_array(s.map(f64::from))),
            rotation.normalize(),
            node.translation.map_or(DVec3::ZERO, |t| DVec3::from_array(t.map(f64::from))),
        )
    };
    if transform.is_finite() {
        Ok(transform)
    } else {
        Err(document.fault(name, "its transform is not finite"))
    }
}

fn single_precision(transform: DAffine3) -> Affine3A {
    let axes = transform.matrix3;
    Affine3A::from_cols(
        axes.x_axis.as_vec3a(),
        axes.y_axis.as_vec3a(),
        axes.z_axis.as_vec3a(),
        transform.translation.as_vec3a(),
    )
}

/// A perspective camera; `None` for an orthographic one. Looks along −z of its node; scale does not matter.
fn camera(
    document: &Document<'_>,
    index: json::Index<json::Camera>,
    from: &str,
    world_from_node: DAffine3,
) -> Result<Option<Camera>, LoadError> {
    let json = document.get(&document.root.cameras, index, "cameras", from)?;
    let name = format!("cameras[{}]", index.value());
    let perspective = match json.type_ {
        Checked::Valid(Projection::Orthographic) => return Ok(None),
        Checked::Valid(Projection::Perspective) => json.perspective.as_ref(),
        Checked::Invalid => None,
    };
    let Some(perspective) = perspective else {
        return Err(document.fault(name, "is neither a perspective nor an orthographic camera"));
    };
    let aspect = perspective.aspect_ratio.unwrap_or(1.0);
    if !(aspect > 0.0 && aspect.is_finite()) {
        return Err(document.fault(name, format!("aspectRatio is {aspect}: it must be above 0")));
    }
    let width = (aspect * DEFAULT_SIDE as f32).round().clamp(1.0, Camera::MAX_SIDE as f32) as u32;
    let forward = world_from_node.transform_vector3(DVec3::NEG_Z).normalize_or_zero();
    let eye = world_from_node.translation;
    // Far enough that eye and target differ in f32.
    let target = eye + forward * (1.0 + eye.length());
    let camera = Camera {
        eye: eye.as_vec3(),
        target: target.as_vec3(),
        up: world_from_node.transform_vector3(DVec3::Y).normalize_or_zero().as_vec3(),
        fov_y: perspective.yfov,
        near: perspective.znear,
        far: perspective.zfar.unwrap_or(f32::INFINITY),
        width,
        height: DEFAULT_SIDE,
    };
    camera.validate().map_err(|fault| document.fault(name, fault.to_string().replace("camera.", "")))?;
    Ok(Some(camera))
}

/// A punctual light: it shines along −z of its node.
fn light(
    document: &Document<'_>,
    index: json::Index<json::extensions::scene::khr_lights_punctual::Light>,
    from: &str,
    world_from_node: DAffine3,
) -> Result<Light, LoadError> {
    let extension = document.root.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref());
    let lights = extension.map_or(&[][..], |e| &e.lights);
    let json = document.get(lights, index, "lights", &format!("{from}.extensions.KHR_lights_punctual"))?;
    let name = format!("lights[{}]", index.value());
    let position = world_from_node.translation.as_vec3();
    let direction: Vec3 = world_from_node.transform_vector3(DVec3::NEG_Z).normalize_or_zero().as_vec3();
    let light = match (&json.type_, &json.spot) {
        (Checked::Valid(LightKind::Directional), _) => Light::Directional { direction, angular_radius: 0.0 },
        (Checked::Valid(LightKind::Point), _) => Light::Point { position },
        (Checked::Valid(LightKind::Spot), Some(cone)) => {
            let (outer, inner) = (cone.outer_cone_angle, cone.inner_cone_angle);
            Light::Spot { position, direction, outer, inner }
        }
        (Checked::Valid(LightKind::Spot), None) => return Err(document.fault(name, "a spot needs 'spot'")),
        (Checked::Invalid, _) => {
            return Err(document.fault(name, "type is none of directional, point and spot"));
        }
    };
    light.validate().map_err(|fault| document.fault(name, fault.to_string().replace("light.", "")))?;
    Ok(light)
}
