//! Casters with nothing behind them: the ground under everything shadows no surface.

use glam::Vec3;

use crate::geometry::Object;
use crate::light::LightPoint;
use crate::{Light, Scene};

/// The casters of a scene, told apart by whether anything lies behind them.
#[derive(Clone, Debug, Default)]
pub struct Backdrops<'a> {
    /// Those that may shadow a surface.
    pub drawn: Vec<&'a Object>,
    /// Flat ones with the whole scene on the light's side: they shadow no surface, only free points beyond.
    pub backdrops: Vec<&'a Object>,
}

/// Tells casters from backdrops: an object whose triangles all lie in one plane, with the whole scene on the
/// side of the light's centre, shadows no surface (but its own back, which is dark by its normal).
///
/// `tolerance` is the distance in scene units below which a point does not count as behind a plane. It must be
/// that of the technique's own comparison: then leaving such a caster out changes no pixel.
pub fn told_apart<'a>(scene: &'a Scene, light: &Light, tolerance: f32) -> Backdrops<'a> {
    let casters = scene.objects().iter().filter(|o| o.flags.casts && !o.triangles.is_empty());
    let (backdrops, drawn) = casters.partition(|object| nothing_behind(scene, light, object, tolerance));
    Backdrops { drawn, backdrops }
}

fn nothing_behind(scene: &Scene, light: &Light, object: &Object, tolerance: f32) -> bool {
    // A mask's holes would have to be looked up for free points; maps do that already.
    if object.alpha.is_some() {
        return false;
    }
    let normal_of = |[a, b, c]: [Vec3; 3]| (b - a).cross(c - a).try_normalize();
    let Some((anchor, normal)) =
        object.triangles.clone().find_map(|t| normal_of(scene.corners(t)).map(|n| (scene.corners(t)[0], n)))
    else {
        return false;
    };
    let towards_light = match light.center() {
        LightPoint::At(place) => normal.dot(place - anchor),
        LightPoint::Towards(direction) => normal.dot(direction) * f32::MAX.sqrt(),
    };
    if towards_light.abs() <= tolerance {
        return false;
    }
    let normal = normal * towards_light.signum();
    let height = |p: Vec3| normal.dot(p - anchor);
    // Half the tolerance each: a point less than the other half behind this plane is less than the whole
    // behind any triangle's own.
    scene.positions()[object.vertices.clone()].iter().all(|&p| height(p).abs() <= 0.5 * tolerance)
        && scene.objects().iter().filter(|o| o.flags.receives).all(|o| {
            o.bounds.is_empty() || o.bounds.corners().into_iter().all(|c| height(c) >= -0.5 * tolerance)
        })
}

#[cfg(test)]
mod tests {
    use glam::Affine3A;

    use super::*;
    use crate::TriangleMesh;
    use crate::geometry::ObjectFlags;

    #[test]
    fn the_ground_under_everything_is_a_backdrop() {
        let mut scene = Scene::new();
        for (y, half) in [(0.0, 50.0), (1.0, 1.0)] {
            let corner = |x: f32, z: f32| Vec3::new(x * half, y, z * half);
            let positions = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
            let quad = TriangleMesh::new("quad", positions, vec![[0, 1, 2], [0, 2, 3]]);
            scene.add(&quad, Affine3A::IDENTITY, ObjectFlags::default()).unwrap();
        }
        let above = [
            Light::Point { position: Vec3::new(0.5, 9.0, 0.2) },
            Light::Directional { direction: Vec3::new(0.3, -1.0, 0.1), angular_radius: 0.0 },
        ];
        for light in &above {
            let casters = told_apart(&scene, light, 1e-5);
            assert_eq!((casters.drawn.len(), casters.backdrops.len()), (1, 1));
        }
        // From below, the ground hides everything.
        let below = Light::Point { position: Vec3::new(0.0, -3.0, 0.0) };
        let casters = told_apart(&scene, &below, 1e-5).drawn;
        assert_eq!((casters.len(), casters[0].bounds.max.y), (1, 0.0));
    }
}
