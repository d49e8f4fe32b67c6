//! Casters with nothing behind them: the ground under everything shadows no surface.

use glam::Vec3;
use rayon::prelude::*;

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
    let casters = scene.objects().par_iter().filter(|o| o.flags.casts && !o.triangles.is_empty());
    let (backdrops, drawn) = casters.partition(|object| nothing_behind(scene, light, object, tolerance));
    Backdrops { drawn, backdrops }
}

/// [`told_apart`], with solids under everything among the backdrops, too: a slab that is the ground under all the rest.
///
/// A closed convex object of at most [`MOST_OF_A_SOLID`] triangles, one of whose faces has the object on one side and the
/// light with all other receivers on the other, shadows nobody but itself, and of itself only the faces that are turned
/// from the light and dark by their normals. Seen from within it would be lit: no camera may be inside of such a solid. The
/// scene must hold the objects' own triangles, not boxes in their places.
pub fn told_apart_with_solids<'a>(scene: &'a Scene, light: &Light, tolerance: f32) -> Backdrops<'a> {
    let mut told = told_apart(scene, light, tolerance);
    let (solids, drawn) =
        told.drawn.iter().partition(|object| is_solid_under_all(scene, light, object, tolerance));
    told.drawn = drawn;
    told.backdrops.extend::<Vec<_>>(solids);
    told
}

/// Every triangle is held against every vertex: a solid of more triangles is not looked for.
pub const MOST_OF_A_SOLID: usize = 64;

fn is_solid_under_all(scene: &Scene, light: &Light, object: &Object, tolerance: f32) -> bool {
    if object.alpha.is_some() || object.triangles.len() > MOST_OF_A_SOLID {
        return false;
    }
    let vertices = &scene.positions()[object.vertices.clone()];
    let mut supports = false;
    for triangle in object.triangles.clone() {
        let [a, b, c] = scene.corners(triangle);
        let Some(normal) = (b - a).cross(c - a).try_normalize() else { return false };
        let heights = vertices.iter().map(|&p| normal.dot(p - a));
        let [low, high] = heights.fold([0.0f32; 2], |[low, high], h| [low.min(h), high.max(h)]);
        // The side that the object is not on, half the tolerance as in `nothing_behind`.
        let outwards = if high <= 0.5 * tolerance {
            normal
        } else if low >= -0.5 * tolerance {
            -normal
        } else {
            return false;
        };
        let towards_light = match light.center() {
            LightPoint::At(place) => outwards.dot(place - a),
            LightPoint::Towards(direction) => outwards.dot(direction) * f32::MAX.sqrt(),
        };
        supports |= towards_light > tolerance
            && scene.objects().iter().filter(|o| o.flags.receives && !std::ptr::eq(*o, object)).all(|o| {
                o.bounds.is_empty()
                    || o.bounds.corners().into_iter().all(|p| outwards.dot(p - a) >= -0.5 * tolerance)
            });
    }
    // Few come here, and sorting edges takes longest.
    supports && is_closed(scene, object)
}

/// Whether each edge of an object, by exact position, is one of two triangles.
fn is_closed(scene: &Scene, object: &Object) -> bool {
    let key = |p: Vec3| (p + Vec3::ZERO).to_array().map(f32::to_bits);
    let mut edges: Vec<_> = object
        .triangles
        .clone()
        .flat_map(|triangle| {
            let [a, b, c] = scene.corners(triangle).map(key);
            [(a, b), (b, c), (c, a)].map(|(from, to)| if from < to { (from, to) } else { (to, from) })
        })
        .collect();
    edges.sort_unstable();
    edges.chunk_by(|a, b| a == b).all(|same| same.len() == 2)
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

    /// A slab under a quad, and a slab that a quad stands within; cut open it is no solid.
    #[test]
    fn a_slab_under_everything_is_a_backdrop() {
        let slab = |open: bool| {
            let corner = |i: u32| {
                let side = |bit: u32| if i >> bit & 1 == 1 { 3.0f32 } else { -3.0 };
                Vec3::new(side(0), if i >> 1 & 1 == 1 { 0.0 } else { -0.5 }, side(2))
            };
            let quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 2, 6, 4], [1, 5, 7, 3], [0, 4, 5, 1], [2, 3, 7, 6]];
            let triangles = quads[usize::from(open)..]
                .iter()
                .flat_map(|q: &[u32; 4]| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]);
            TriangleMesh::new("slab", (0..8).map(corner).collect(), triangles.collect())
        };
        let light = Light::Point { position: Vec3::new(0.5, 9.0, 0.2) };
        let below = Light::Point { position: Vec3::new(0.5, -9.0, 0.2) };
        for (height, open, light, solids) in
            [(0.0, false, light, 1), (-0.1, false, light, 0), (0.0, true, light, 0), (0.0, false, below, 0)]
        {
            let mut scene = Scene::new();
            let positions = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]].map(|[x, y]| Vec3::new(x, y + height, 0.0));
            let wall = TriangleMesh::new("wall", positions.to_vec(), vec![[0, 1, 2]]);
            for mesh in [slab(open), wall] {
                scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).unwrap();
            }
            assert_eq!(told_apart(&scene, &light, 1e-5).backdrops.len(), 0);
            let told = told_apart_with_solids(&scene, &light, 1e-5);
            assert_eq!((told.backdrops.len(), told.drawn.len()), (solids, 2 - solids), "{height} {open}");
        }
    }
}
