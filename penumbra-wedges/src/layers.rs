//! How many layers lie between a receiver and the light's middle: where sums over edges start.

use glam::Vec3;
use scene_core::Scene;
use scene_core::bvh::{Bvh, blocks};
use scene_core::geometry::Aabb;
use scene_core::light::LightPoint;

/// The number of faces with a facing that the shadow ray from `origin` to `target` crosses, each decided exactly
/// ([`blocks`]). A ray through the common edge of two faces that lie on both sides of it crosses one layer there.
pub fn layers_before(scene: &Scene, tree: &Bvh, facing: &[i8], origin: Vec3, target: LightPoint) -> i32 {
    let (direction, end) = target.ray_from(origin);
    let mut crossed: Vec<[Vec3; 3]> = Vec::new();
    tree.visit(
        |bounds| may_cross(bounds, origin, direction, end),
        |triangle| {
            let turn = facing[triangle as usize];
            let corners = scene.corners(triangle as usize);
            if turn != 0 && blocks(corners, origin, target) {
                let [a, b, c] = corners;
                crossed.push(if turn > 0 { corners } else { [a, c, b] });
            }
        },
    );
    let is_met_before = |(index, face): &(usize, &[Vec3; 3])| {
        crossed[..*index].iter().any(|before| run_opposite_ways(before, face))
    };
    crossed.iter().enumerate().filter(|pair| !is_met_before(pair)).count() as i32
}

/// Whether two turned faces have an edge in common that they run along in opposite ways: then they lie on both sides of it.
fn run_opposite_ways(a: &[Vec3; 3], b: &[Vec3; 3]) -> bool {
    let edges = |face: &[Vec3; 3]| [0, 1, 2].map(|i| (face[i], face[(i + 1) % 3]));
    edges(a).into_iter().any(|(from, to)| edges(b).contains(&(to, from)))
}

/// Whether a ray may cross a box, erring to yes, by slabs in f64. Corners are rounded relative to the origin as
/// [`blocks`] does, which keeps their order.
#[inline]
fn may_cross(bounds: Aabb, origin: Vec3, direction: Vec3, end: f32) -> bool {
    let (low, high) = (bounds.min - origin, bounds.max - origin);
    let (mut first, mut last) = (0.0_f64, f64::from(end));
    for axis in 0..3 {
        let (d, low, high) = (f64::from(direction[axis]), f64::from(low[axis]), f64::from(high[axis]));
        if d == 0.0 {
            if low > 0.0 || high < 0.0 {
                return false;
            }
        } else {
            let (a, b) = (low / d, high / d);
            first = first.max(a.min(b));
            last = last.min(a.max(b));
        }
    }
    // Quotients are rounded by at most 2⁻⁵³ of themselves each.
    first <= last * (1.0 + 4.0 * f64::EPSILON)
}

#[cfg(test)]
mod tests {
    use glam::Affine3A;
    use scene_core::TriangleMesh;
    use scene_core::geometry::{ObjectFlags, facing};

    use super::*;

    /// Sheets at these heights, each of two triangles with their diagonal through x = z.
    fn sheets(heights: &[f32]) -> Scene {
        let mut scene = Scene::new();
        for &y in heights {
            let corners =
                [[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]].map(|[x, z]| Vec3::new(x, y, z));
            let mesh = TriangleMesh::new("sheet", corners.to_vec(), vec![[0, 1, 2], [0, 2, 3]]);
            scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).unwrap();
        }
        scene
    }

    #[test]
    fn layers_in_one_place_count_and_a_diagonal_counts_once() {
        let scene = sheets(&[1.0, 1.0, 1.5, 3.5]);
        let tree = Bvh::casters(&scene);
        for target in [LightPoint::At(Vec3::Y * 3.0), LightPoint::Towards(Vec3::Y)] {
            let facing = facing(scene.positions(), scene.triangles(), target);
            let above = i32::from(matches!(target, LightPoint::Towards(_)));
            let count = |x: f32, z: f32| layers_before(&scene, &tree, &facing, Vec3::new(x, 0.0, z), target);
            assert_eq!(count(0.2, 0.1), 3 + above);
            assert_eq!(
                count(0.25, 0.25),
                3 + above - 1,
                "of two sheets in one place the diagonals are one, too"
            );
            assert_eq!(count(5.0, 0.0), 0);
        }
        let scene = sheets(&[1.0]);
        let facing = facing(scene.positions(), scene.triangles(), LightPoint::Towards(Vec3::Y));
        let tree = Bvh::casters(&scene);
        let on_diagonal = Vec3::new(0.25, 0.0, 0.25);
        assert_eq!(layers_before(&scene, &tree, &facing, on_diagonal, LightPoint::Towards(Vec3::Y)), 1);
        let none = vec![0; facing.len()];
        assert_eq!(layers_before(&scene, &tree, &none, on_diagonal, LightPoint::Towards(Vec3::Y)), 0);
    }
}
