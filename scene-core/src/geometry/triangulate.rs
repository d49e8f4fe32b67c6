//! Polygons to triangles.
//!
//! Quads are split along the diagonal whose halves face the same way; convex polygons are fanned; all others
//! are triangulated by constrained Delaunay (`spade`, exact predicates) in the polygon's best-fit plane
//! (Newell's normal). No vertex is added. The triangles keep the polygon's orientation and cover exactly the
//! region around which its boundary winds.
//!
//! | polygon | what comes out |
//! | --- | --- |
//! | repeated consecutive corners | the repetition is ignored |
//! | touches itself at a corner or along an edge (a hole joined by a bridge) | the region it winds around |
//! | winds around a region twice | that region once, [`Repair::Overlap`] |
//! | a quad that crosses itself, or is folded | two triangles along its first diagonal, [`Repair::Folded`] |
//! | any other that crosses itself, seen along its normal | the triangles of its corners whose middles it winds around, [`Repair::Crossing`]; refused beyond [`MAX_CROSSING`] corners, or if its parts cancel: [`PolygonFault::Crosses`] |
//! | no area (collinear, fewer than three places) | nothing, [`Repair::NoArea`] |
//! | not planar | the triangles of its projection, with the true corners |

use glam::{DVec2, DVec3, Vec3};
use spade::{
    ConstrainedDelaunayTriangulation, Intersection, LineIntersectionIterator, Point2, Triangulation,
};
use thiserror::Error;

/// What had to be mended in a polygon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Repair {
    /// It covers no area and gives no triangle.
    NoArea,
    /// A quad is folded or crosses itself.
    Folded,
    /// It covers a part of itself twice.
    Overlap,
    /// It crosses itself; near the crossings, its outline is only approximated.
    Crossing,
}

/// Corners of the largest polygon that is mended if it crosses itself: mending takes O(n²) time.
pub const MAX_CROSSING: usize = 4096;

/// Why a polygon was refused.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum PolygonFault {
    /// Sides cross, and what is inside cannot be told.
    #[error("the polygon of {corners} corners crosses itself: split it")]
    Crosses {
        /// Its corners.
        corners: usize,
    },
    /// A corner is NaN or infinite.
    #[error("corner {corner} of the polygon is not finite")]
    NotFinite {
        /// The corner, from 0.
        corner: usize,
    },
}

/// Triangulates the polygon through `corners` and appends its triangles, as indices of corners, to
/// `triangles`. Fewer than three corners give none.
///
/// Takes O(1) for triangles and quads, O(n) for convex polygons and O(n log n) for most others.
///
/// # Errors
/// See the table of the module; `triangles` is unchanged then.
pub fn triangulate(corners: &[Vec3], triangles: &mut Vec<[u32; 3]>) -> Result<Option<Repair>, PolygonFault> {
    match *corners {
        [] | [_] | [_, _] => Ok(Some(Repair::NoArea)),
        [_, _, _] => {
            triangles.push([0, 1, 2]);
            Ok(None)
        }
        [a, b, c, d] => Ok(split_quad([a, b, c, d], triangles)),
        _ => triangulate_polygon(corners, triangles),
    }
}

/// Two triangles of a quad: along the diagonal 0–2, as fans do, unless its halves face opposite ways (the
/// quad is concave at 1 or 3) or one of them is flat, and the other diagonal does better.
fn split_quad(quad: [Vec3; 4], triangles: &mut Vec<[u32; 3]>) -> Option<Repair> {
    let [a, b, c, d] = quad.map(Vec3::as_dvec3);
    let agreement = |n: DVec3, m: DVec3| n.dot(m);
    let first = agreement((b - a).cross(c - a), (c - a).cross(d - a));
    let second = || agreement((c - b).cross(d - b), (d - b).cross(a - b));
    if first <= 0.0 && second() > 0.0 {
        triangles.extend([[1, 2, 3], [1, 3, 0]]);
        return None;
    }
    triangles.extend([[0, 1, 2], [0, 2, 3]]);
    // Flat halves are left for the removal of faces without area.
    (first < 0.0).then_some(Repair::Folded)
}

/// Five corners and more.
fn triangulate_polygon(
    corners: &[Vec3],
    triangles: &mut Vec<[u32; 3]>,
) -> Result<Option<Repair>, PolygonFault> {
    if let Some(corner) = corners.iter().position(|p| !p.is_finite()) {
        return Err(PolygonFault::NotFinite { corner });
    }
    // Relative to the first corner: a polygon far from the origin keeps its precision.
    let origin = corners[0].as_dvec3();
    let local: Vec<DVec3> = corners.iter().map(|p| p.as_dvec3() - origin).collect();
    let Some(normal) = newell_normal(&local).try_normalize() else {
        // No net area: flat, or two lobes that cancel.
        let flat = local.iter().max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
        let longest = flat.copied().unwrap_or(DVec3::ZERO);
        return if local.iter().all(|p| p.cross(longest) == DVec3::ZERO) {
            Ok(Some(Repair::NoArea))
        } else {
            Err(PolygonFault::Crosses { corners: corners.len() })
        };
    };
    let (x, y) = normal.any_orthonormal_pair();
    let flat: Vec<DVec2> = local.iter().map(|p| DVec2::new(p.dot(x), p.dot(y))).collect();
    if is_strictly_convex(&flat) {
        triangles.extend((1..corners.len() as u32 - 1).map(|i| [0, i, i + 1]));
        return Ok(None);
    }
    triangulate_flat(&flat, triangles)
}

/// Twice the vector area: its direction is the normal of the best-fit plane.
fn newell_normal(corners: &[DVec3]) -> DVec3 {
    let next = corners.iter().cycle().skip(1);
    corners.iter().zip(next).map(|(a, b)| a.cross(*b)).sum()
}

/// Whether every corner turns left and the polygon goes round once.
fn is_strictly_convex(polygon: &[DVec2]) -> bool {
    let n = polygon.len();
    let side = |i: usize| polygon[(i + 1) % n] - polygon[i];
    // Once around, x changes its direction exactly twice.
    let mut turns = 0;
    for i in 0..n {
        let (a, b, c) = (polygon[i], polygon[(i + 1) % n], polygon[(i + 2) % n]);
        if orient(a, b, c) <= 0.0 {
            return false;
        }
        turns += usize::from((side(i).x >= 0.0) != (side((i + 1) % n).x >= 0.0));
    }
    turns == 2
}

/// Positive if `a`, `b`, `c` turn left; the sign is exact.
fn orient(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    let coordinate = |p: DVec2| robust::Coord { x: p.x, y: p.y };
    robust::orient2d(coordinate(a), coordinate(b), coordinate(c))
}

type Cdt = ConstrainedDelaunayTriangulation<Point2<f64>>;

/// Constrained Delaunay of the sides; what the boundary winds around is kept.
fn triangulate_flat(
    polygon: &[DVec2],
    triangles: &mut Vec<[u32; 3]>,
) -> Result<Option<Repair>, PolygonFault> {
    let crosses = PolygonFault::Crosses { corners: polygon.len() };
    let (points, point_of_corner, corner_of_point) = distinct_points(polygon);
    if points.len() < 3 {
        return Ok(Some(Repair::NoArea));
    }
    let n = polygon.len();
    let sides: Vec<[usize; 2]> = (0..n)
        .map(|i| [point_of_corner[i], point_of_corner[(i + 1) % n]])
        .filter(|[from, to]| from != to)
        .collect();
    let mut conflict = false;
    let cdt = Cdt::try_bulk_load_cdt(points, sides.clone(), |_| conflict = true).map_err(|_| crosses)?;
    if conflict && n > MAX_CROSSING {
        return Err(crosses);
    }
    if cdt.num_inner_faces() == 0 {
        return Ok(Some(Repair::NoArea));
    }
    let winding = if conflict { winding_of_middles(&cdt, polygon) } else { winding_numbers(&cdt, &sides) };
    let mut overlap = false;
    for face in cdt.inner_faces() {
        let w = winding[face.fix().index()];
        overlap |= w.abs() > 1;
        let [a, b, c] = face.vertices().map(|v| corner_of_point[v.fix().index()]);
        match w {
            0 => {}
            1.. => triangles.push([a, b, c]),
            _ => triangles.push([a, c, b]),
        }
    }
    Ok(match (conflict, overlap) {
        (true, _) => Some(Repair::Crossing),
        (false, true) => Some(Repair::Overlap),
        (false, false) => None,
    })
}

/// The polygon's distinct places, the place of each corner, and the first corner at each place.
fn distinct_points(polygon: &[DVec2]) -> (Vec<Point2<f64>>, Vec<usize>, Vec<u32>) {
    let mut order: Vec<u32> = (0..polygon.len() as u32).collect();
    // Below what exact predicates can multiply, a coordinate is zero, and that without a sign: places are told apart
    // after that.
    let place = |p: &DVec2| {
        let Point2 { x, y } = spade::mitigate_underflow(Point2::new(p.x, p.y));
        Point2::new(x + 0.0, y + 0.0)
    };
    let places: Vec<Point2<f64>> = polygon.iter().map(place).collect();
    let position = |i: u32| places[i as usize];
    order.sort_by(|&i, &j| {
        let (a, b) = (position(i), position(j));
        a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)).then(i.cmp(&j))
    });
    let mut point_of_corner = vec![0; polygon.len()];
    let (mut points, mut corner_of_point) = (Vec::new(), Vec::new());
    for run in order.chunk_by(|&i, &j| position(i) == position(j)) {
        for &corner in run {
            point_of_corner[corner as usize] = points.len();
        }
        points.push(position(run[0]));
        corner_of_point.push(run[0]);
    }
    (points, point_of_corner, corner_of_point)
}

/// How often the sides wind around each face of the triangulation, counter-clockwise positive; 0 outside.
fn winding_numbers(cdt: &Cdt, sides: &[[usize; 2]]) -> Vec<i32> {
    // Net number of sides that run along each directed edge. A side may run along several edges, when other
    // corners lie on it, and several sides along one edge.
    let handles: Vec<_> = cdt.fixed_vertices().collect();
    let mut along = vec![0i32; cdt.num_directed_edges()];
    for &[from, to] in sides {
        for hit in LineIntersectionIterator::new_from_handles(cdt, handles[from], handles[to]) {
            if let Intersection::EdgeOverlap(edge) = hit {
                along[edge.fix().index()] += 1;
                along[edge.rev().fix().index()] -= 1;
            }
        }
    }
    let mut winding: Vec<Option<i32>> = vec![None; cdt.num_all_faces()];
    let outside = cdt.outer_face();
    winding[outside.fix().index()] = Some(0);
    let mut to_visit: Vec<_> = cdt.convex_hull().map(|edge| (edge.rev(), 0)).collect();
    to_visit.extend(cdt.convex_hull().map(|edge| (edge, 0)));
    while let Some((edge, across)) = to_visit.pop() {
        // `edge` has the unvisited face on its left, and `across` is the winding on its right.
        let face = edge.face();
        if winding[face.fix().index()].is_some() {
            continue;
        }
        let w = across + along[edge.fix().index()];
        winding[face.fix().index()] = Some(w);
        if let Some(face) = face.as_inner() {
            to_visit.extend(face.adjacent_edges().map(|e| (e.rev(), w)));
        }
    }
    winding.into_iter().map(|w| w.unwrap_or(0)).collect()
}

/// How often the polygon winds around the middle of each face: for polygons whose crossing sides are not all
/// edges of the triangulation.
fn winding_of_middles(cdt: &Cdt, polygon: &[DVec2]) -> Vec<i32> {
    let mut winding = vec![0; cdt.num_all_faces()];
    for face in cdt.inner_faces() {
        let middle = face.center();
        let middle = DVec2::new(middle.x, middle.y);
        let next = polygon.iter().cycle().skip(1);
        winding[face.fix().index()] = polygon
            .iter()
            .zip(next)
            .map(|(&a, &b)| match (a.y <= middle.y, b.y <= middle.y) {
                (true, false) if orient(a, b, middle) > 0.0 => 1,
                (false, true) if orient(a, b, middle) < 0.0 => -1,
                _ => 0,
            })
            .sum();
    }
    winding
}

#[cfg(test)]
mod tests {
    use super::*;

    fn polygon(points: &[[f32; 2]]) -> Vec<Vec3> {
        points.iter().map(|&[x, y]| Vec3::new(x, y, 0.0)).collect()
    }

    fn run(corners: &[Vec3]) -> (Vec<[u32; 3]>, Option<Repair>) {
        let mut triangles = Vec::new();
        let repair = triangulate(corners, &mut triangles).unwrap();
        (triangles, repair)
    }

    /// Vector areas, in f64.
    fn vector_areas(corners: &[Vec3], triangles: &[[u32; 3]]) -> Vec<DVec3> {
        let corner = |i: u32| corners[i as usize].as_dvec3();
        triangles
            .iter()
            .map(|&[a, b, c]| (corner(b) - corner(a)).cross(corner(c) - corner(a)) * 0.5)
            .collect()
    }

    /// The triangles have the polygon's area and orientation: then they cover it without overlap, since
    /// the sum of absolute areas equals that of signed ones.
    fn assert_covers(corners: &[Vec3], triangles: &[[u32; 3]]) {
        let expected = newell_normal(&corners.iter().map(|p| p.as_dvec3()).collect::<Vec<_>>()) * 0.5;
        let areas = vector_areas(corners, triangles);
        let sum: DVec3 = areas.iter().sum();
        let total: f64 = areas.iter().map(|a| a.length()).sum();
        assert!((sum - expected).length() <= 1e-9 * expected.length(), "{sum} {expected}");
        assert!((total - expected.length()).abs() <= 1e-9 * total, "{total} {}", expected.length());
    }

    const L_SHAPE: [[f32; 2]; 6] = [[0., 0.], [2., 0.], [2., 1.], [1., 1.], [1., 2.], [0., 2.]];

    #[test]
    fn concave_polygons_keep_area_and_orientation() {
        let l = polygon(&L_SHAPE);
        assert_covers(&l, &run(&l).0);
        let reversed: Vec<_> = l.iter().rev().copied().collect();
        assert_covers(&reversed, &run(&reversed).0);
        // Turned into another plane, a kilometre off the origin.
        let turned: Vec<_> = l.iter().map(|p| Vec3::new(1024.0 + p.x, -p.x, 1024.0 + p.y)).collect();
        assert_covers(&turned, &run(&turned).0);
    }

    #[test]
    fn a_comb_of_many_teeth_is_covered() {
        let mut points = vec![[0.0, 0.0], [200.0, 0.0]];
        for tooth in (0..100).rev() {
            points.extend([[2.0 * tooth as f32 + 1.5, 10.0], [2.0 * tooth as f32 + 0.5, 1.0]]);
        }
        let comb = polygon(&points);
        let (triangles, repair) = run(&comb);
        assert_eq!((triangles.len(), repair), (comb.len() - 2, None));
        assert_covers(&comb, &triangles);
    }

    #[test]
    fn quads_choose_the_diagonal_inside() {
        let square = polygon(&[[0., 0.], [1., 0.], [1., 1.], [0., 1.]]);
        assert_eq!(run(&square).0, [[0, 1, 2], [0, 2, 3]]);
        let dart = polygon(&[[0., 0.], [1., 0.1], [2., 0.], [1., 2.]]);
        let (triangles, repair) = run(&dart);
        assert_eq!((triangles.as_slice(), repair), (&[[1, 2, 3], [1, 3, 0]][..], None));
        assert_covers(&dart, &triangles);
        // A corner on the diagonal: the other diagonal leaves no face without area.
        let t = polygon(&[[0., 0.], [1., 0.], [2., 0.], [1., 2.]]);
        assert_covers(&t, &run(&t).0);
        assert!(vector_areas(&t, &run(&t).0).iter().all(|a| a.length() > 0.1));
    }

    #[test]
    fn a_bow_tie_is_told() {
        let bow_tie = polygon(&[[0., 0.], [1., 1.], [1., 0.], [0., 1.]]);
        assert_eq!(run(&bow_tie).1, Some(Repair::Folded));
    }

    #[test]
    fn a_hole_joined_by_a_bridge_stays_a_hole() {
        let frame = polygon(&[
            [0., 0.],
            [4., 0.],
            [4., 4.],
            [0., 4.],
            [0., 0.], // around
            [1., 1.],
            [1., 3.],
            [3., 3.],
            [3., 1.],
            [1., 1.], // the hole, the other way
        ]);
        let (triangles, repair) = run(&frame);
        assert_eq!(repair, None);
        let areas = vector_areas(&frame, &triangles);
        assert!(areas.iter().all(|a| a.z > 0.0));
        assert!((areas.iter().map(|a| a.z).sum::<f64>() - 12.0).abs() < 1e-12);
    }

    #[test]
    fn touching_corners_and_edges_are_allowed() {
        // Two lobes that meet in a corner, one of them the other way round.
        let lobes = polygon(&[[0., 0.], [2., 1.], [2., -1.], [0., 0.], [-3., 1.], [-3., -1.]]);
        let (triangles, _) = run(&lobes);
        let areas = vector_areas(&lobes, &triangles);
        assert!((areas.iter().map(|a| a.length()).sum::<f64>() - 5.0).abs() < 1e-12);
        assert!((areas.iter().map(|a| a.z).sum::<f64>() - 1.0).abs() < 1e-12);
        // A corner that touches the opposite side.
        let touch = polygon(&[[0., 0.], [4., 0.], [4., 2.], [2., 0.], [0., 2.]]);
        assert_covers(&touch, &run(&touch).0);
    }

    #[test]
    fn going_round_twice_counts_once() {
        let once = [[0., 0.], [1., 0.], [1., 1.], [0., 1.]];
        let twice = polygon(&[once, once].concat());
        let (triangles, repair) = run(&twice);
        assert_eq!((triangles.len(), repair), (2, Some(Repair::Overlap)));
    }

    #[test]
    fn repeated_and_collinear_corners_do_no_harm() {
        let p = polygon(&[[0., 0.], [0., 0.], [1., 0.], [2., 0.], [2., 2.], [2., 2.], [0., 2.]]);
        let (triangles, repair) = run(&p);
        assert_eq!(repair, None);
        assert_covers(&p, &triangles);
        assert!(vector_areas(&p, &triangles).iter().all(|a| a.length() > 0.1));
    }

    #[test]
    fn flat_polygons_give_nothing() {
        let line = polygon(&[[0., 0.], [1., 1.], [3., 3.], [2., 2.], [0.5, 0.5]]);
        assert_eq!(run(&line), (vec![], Some(Repair::NoArea)));
        assert_eq!(run(&[Vec3::ONE; 9]), (vec![], Some(Repair::NoArea)));
        assert_eq!(run(&[Vec3::ONE, Vec3::X]), (vec![], Some(Repair::NoArea)));
    }

    #[test]
    fn crossing_polygons_are_mended() {
        // A square with one side that crosses into a small loop.
        let loops =
            polygon(&[[0., 0.], [4., 0.], [4., 4.], [2., 4.], [1., 5.], [2., 5.], [1., 4.], [0., 4.]]);
        let (triangles, repair) = run(&loops);
        assert_eq!(repair, Some(Repair::Crossing));
        let area: f64 = vector_areas(&loops, &triangles).iter().map(|a| a.length()).sum();
        assert!((15.5..17.5).contains(&area), "{area}");
    }

    #[test]
    fn what_cannot_be_mended_is_refused() {
        let star: Vec<_> = (0..5)
            .map(|i| {
                let angle = (i * 2) as f32 * std::f32::consts::TAU / 5.0;
                Vec3::new(angle.cos(), angle.sin(), 0.0)
            })
            .collect();
        let star: Vec<_> = star.into_iter().cycle().take(5 * 1000).collect();
        // Two lobes of equal area in opposite directions.
        let eight = polygon(&[[0., 0.], [1., 1.], [2., 0.], [2., 1.], [1., 0.], [0., 1.]]);
        let mut triangles = vec![[7, 8, 9]];
        assert_eq!(triangulate(&eight, &mut triangles), Err(PolygonFault::Crosses { corners: 6 }));
        assert_eq!(triangulate(&star, &mut triangles), Err(PolygonFault::Crosses { corners: 5000 }));
        assert_eq!(triangles, [[7, 8, 9]]);
        let nan = [Vec3::ZERO, Vec3::X, Vec3::ONE, Vec3::NAN, Vec3::Y];
        assert_eq!(triangulate(&nan, &mut triangles), Err(PolygonFault::NotFinite { corner: 3 }));
    }

    #[test]
    fn warped_polygons_use_their_true_corners() {
        let mut l = polygon(&L_SHAPE);
        l[3].z = 0.3;
        let (triangles, _) = run(&l);
        assert_eq!(triangles.len(), 4);
        assert!(vector_areas(&l, &triangles).iter().all(|a| a.z > 0.0));
    }

    /// Corners that fall together in the best-fit plane, but for the sign of a zero.
    #[test]
    fn corners_apart_by_the_sign_of_zero_are_one_place() {
        let tangle = [
            [0, -1, 0],
            [-2, 0, 0],
            [0, 1, 0],
            [-3, 2, 0],
            [-2, -1, 0],
            [0, 3, 0],
            [-3, -1, 0],
            [-2, 1, 0],
            [3, -2, 1],
            [1, -2, 1],
        ];
        let corners = tangle.map(|p: [i8; 3]| Vec3::from_array(p.map(f32::from)));
        let (triangles, _) = run(&corners);
        assert!(!triangles.is_empty());
        assert!(triangles.iter().flatten().all(|&i| (i as usize) < corners.len()));
    }

    proptest::proptest! {
        /// A star-shaped polygon around the origin never crosses itself, whatever its radii.
        #[test]
        fn star_shaped_polygons_are_covered(radii in proptest::collection::vec(0.1f32..10.0, 5..60), tilt in -1.0f32..1.0) {
            let n = radii.len() as f32;
            let corners: Vec<_> = radii.iter().enumerate().map(|(i, r)| {
                let angle = i as f32 * std::f32::consts::TAU / n;
                let (x, y) = (r * angle.cos(), r * angle.sin());
                Vec3::new(x, y, tilt * x)
            }).collect();
            let (triangles, _) = run(&corners);
            let expected = newell_normal(&corners.iter().map(|p| p.as_dvec3()).collect::<Vec<_>>()).length() * 0.5;
            let total: f64 = vector_areas(&corners, &triangles).iter().map(|a| a.length()).sum();
            // z is rounded to f32, so the corners leave their plane by up to 2⁻²⁴ of 10.
            proptest::prop_assert!((total - expected).abs() <= 1e-5 * expected, "{} {}", total, expected);
        }

        /// Random corners: covered, or refused, never a panic and never an index out of range.
        #[test]
        fn random_polygons_never_panic(points in proptest::collection::vec((-3i8..4, -3i8..4, 0i8..2), 3..14)) {
            let corners: Vec<_> = points.iter().map(|&(x, y, z)| Vec3::new(x.into(), y.into(), z.into())).collect();
            let mut triangles = Vec::new();
            if triangulate(&corners, &mut triangles).is_ok() {
                proptest::prop_assert!(triangles.iter().flatten().all(|&i| (i as usize) < corners.len()));
            }
        }
    }
}
