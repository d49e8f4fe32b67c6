//! From the fields of a scene file to places, lights and cameras. Errors are a field and a sentence.

use glam::{Affine3A, EulerRot, Quat, Vec3};

use super::schema::{CameraEntry, LightEntry, MeshTable};
use crate::io::framing::{self, FramingError, UpAxis};
use crate::{Camera, Light, Scene};

/// A field's name within its table, and what is wrong with it.
pub(super) type FieldFault = (&'static str, String);

/// Where the mesh stands: scaled, then rotated, then translated.
pub(super) fn world_from_mesh(mesh: &MeshTable) -> Result<Affine3A, FieldFault> {
    let finite = |field: &'static str, values: &[f32]| match values.iter().find(|v| !v.is_finite()) {
        Some(value) => Err((field, format!("{value} is not finite"))),
        None => Ok(()),
    };
    let translation = mesh.translate.unwrap_or_default();
    finite("translate", &translation)?;
    let scale = mesh.scale.map_or([1.0; 3], |scale| scale.0);
    finite("scale", &scale)?;
    if scale.contains(&0.0) {
        return Err(("scale", "a factor of 0 leaves nothing of the mesh".to_owned()));
    }
    let rotation = match mesh.rotate.as_deref() {
        None => Quat::IDENTITY,
        Some(numbers) => {
            finite("rotate", numbers)?;
            match *numbers {
                [x, y, z] => {
                    let [x, y, z] = [x, y, z].map(f32::to_radians);
                    Quat::from_euler(EulerRot::ZYX, z, y, x)
                }
                [x, y, z, w] => {
                    let quaternion = Quat::from_xyzw(x, y, z, w);
                    let length = quaternion.length();
                    if !(length > 0.0 && length.is_finite()) {
                        return Err(("rotate", "a quaternion of no length turns nowhere".to_owned()));
                    }
                    quaternion.normalize()
                }
                _ => {
                    let message = format!(
                        "3 angles in degrees or the 4 numbers of a quaternion are needed, and there are {}",
                        numbers.len()
                    );
                    return Err(("rotate", message));
                }
            }
        }
    };
    Ok(Affine3A::from_scale_rotation_translation(
        Vec3::from_array(scale),
        rotation,
        Vec3::from_array(translation),
    ))
}

/// The light that an entry describes, with the fields its kind needs and no others.
pub(super) fn light(entry: &LightEntry) -> Result<Light, FieldFault> {
    let fields: &[&str] = match entry.kind.as_str() {
        "directional" => &["direction", "angular_radius_deg"],
        "point" => &["position"],
        "spot" => &["position", "direction", "outer_deg", "inner_deg"],
        "sphere" => &["center", "radius"],
        "rect" => &["center", "half_u", "half_v"],
        "disk" => &["center", "normal", "radius"],
        other => {
            let message = format!("'{other}' is none of directional, point, spot, sphere, rect and disk");
            return Err(("kind", message));
        }
    };
    let kind = &entry.kind;
    for (field, given) in [
        ("center", entry.center.is_some()),
        ("half_u", entry.half_u.is_some()),
        ("half_v", entry.half_v.is_some()),
        ("normal", entry.normal.is_some()),
        ("radius", entry.radius.is_some()),
        ("direction", entry.direction.is_some()),
        ("angular_radius_deg", entry.angular_radius_deg.is_some()),
        ("position", entry.position.is_some()),
        ("outer_deg", entry.outer_deg.is_some()),
        ("inner_deg", entry.inner_deg.is_some()),
    ] {
        if given && !fields.contains(&field) {
            return Err((field, format!("a {kind} light has no such field: it has {}", fields.join(", "))));
        }
    }
    let missing = |field: &'static str| (field, format!("is missing: a {kind} light needs it"));
    let point = |field, value: Option<[f32; 3]>| value.map(Vec3::from_array).ok_or_else(|| missing(field));
    let number = |field, value: Option<f32>| value.ok_or_else(|| missing(field));
    Ok(match kind.as_str() {
        "directional" => Light::Directional {
            direction: point("direction", entry.direction)?,
            angular_radius: entry.angular_radius_deg.unwrap_or(0.0).to_radians(),
        },
        "point" => Light::Point { position: point("position", entry.position)? },
        "spot" => {
            let outer_deg = number("outer_deg", entry.outer_deg)?;
            Light::Spot {
                position: point("position", entry.position)?,
                direction: point("direction", entry.direction)?,
                outer: outer_deg.to_radians(),
                inner: entry.inner_deg.unwrap_or(outer_deg).to_radians(),
            }
        }
        "sphere" => {
            Light::Sphere { center: point("center", entry.center)?, radius: number("radius", entry.radius)? }
        }
        "rect" => Light::Rect {
            center: point("center", entry.center)?,
            half_u: point("half_u", entry.half_u)?,
            half_v: point("half_v", entry.half_v)?,
        },
        _ => Light::Disk {
            center: point("center", entry.center)?,
            normal: point("normal", entry.normal)?,
            radius: number("radius", entry.radius)?,
        },
    })
}

/// The camera that an entry describes; what it lacks is chosen by the rule of [`framing`].
pub(super) fn camera(entry: &CameraEntry, scene: &Scene, up: UpAxis) -> Result<Camera, FramingError> {
    let width = entry.width.unwrap_or(framing::DEFAULT_SIDE);
    let height = entry.height.unwrap_or(framing::DEFAULT_SIDE);
    let [eye, target] = [entry.eye, entry.target].map(|point| point.map(Vec3::from_array));
    let (eye, target) = match (eye, target) {
        (Some(eye), Some(target)) => (eye, target),
        (Some(eye), None) => (eye, scene.bounds().center()),
        (None, target) => {
            let framed = framing::framed_camera(scene.positions(), up, width, height)?;
            let target = target.unwrap_or(framed.target);
            (target + (framed.eye - framed.target), target)
        }
    };
    Ok(Camera {
        eye,
        target,
        up: entry.up.map_or(up.direction(), Vec3::from_array),
        fov_y: entry.fov_y_deg.unwrap_or(framing::DEFAULT_FOV_Y_DEG).to_radians(),
        near: entry.near.unwrap_or_else(|| framing::default_near(eye.distance(target))),
        far: entry.far.unwrap_or(f32::INFINITY),
        width,
        height,
    })
}

#[cfg(test)]
mod tests {
    use super::super::schema::Scale;
    use super::*;

    #[test]
    fn a_mesh_is_scaled_then_turned_about_x_y_z_then_moved() {
        let table = MeshTable {
            translate: Some([10.0, 0.0, 0.0]),
            rotate: Some(vec![90.0, 0.0, 90.0]),
            scale: Some(Scale([1.0, 2.0, 1.0])),
            ..Default::default()
        };
        // y, doubled, turns to z about x, and stays there about z.
        let moved = world_from_mesh(&table).unwrap().transform_point3(Vec3::Y);
        assert!((moved - Vec3::new(10.0, 0.0, 2.0)).length() < 1e-5, "{moved}");
        let quaternion = Quat::from_rotation_z(0.3);
        let table = MeshTable { rotate: Some((quaternion * 3.0).to_array().to_vec()), ..Default::default() };
        let moved = world_from_mesh(&table).unwrap().transform_point3(Vec3::X);
        assert!((moved - quaternion * Vec3::X).length() < 1e-6);
    }

    #[test]
    fn places_that_leave_nothing_are_refused() {
        let fault = |table: MeshTable| world_from_mesh(&table).unwrap_err().0;
        assert_eq!(fault(MeshTable { scale: Some(Scale([1.0, 0.0, 1.0])), ..Default::default() }), "scale");
        assert_eq!(fault(MeshTable { rotate: Some(vec![0.0; 4]), ..Default::default() }), "rotate");
        assert_eq!(fault(MeshTable { rotate: Some(vec![1.0; 2]), ..Default::default() }), "rotate");
        assert_eq!(
            fault(MeshTable { translate: Some([f32::NAN, 0.0, 0.0]), ..Default::default() }),
            "translate"
        );
    }
}
