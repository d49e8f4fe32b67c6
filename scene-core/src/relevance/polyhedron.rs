//! Convex polyhedra as half-spaces and vertices, in f64: made by clipping a box.
//!
//! A clipped polyhedron may be larger than the true one, never smaller by more than rounding: a vertex is off by
//! at most 2⁻⁴⁸ of the largest coordinate for each plane that cut it. Whoever decides "outside" from one gives its
//! planes a margin that covers this; those of [`super::Receivers`] are 2³⁰ times as wide.

use glam::DVec3;

use crate::geometry::Aabb;

/// All points x with `normal`·x ≤ `offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfSpace {
    /// Unit vector that points out.
    pub normal: DVec3,
    /// Distance of the border from the origin along `normal`, in scene units.
    pub offset: f64,
}

/// Where a box lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// All of it outside.
    Outside,
    /// Perhaps across the border.
    Across,
    /// All of it inside.
    Inside,
}

impl HalfSpace {
    /// How far `point` lies outside; negative inside.
    #[inline]
    pub fn height(&self, point: DVec3) -> f64 {
        self.normal.dot(point) - self.offset
    }

    /// The half-space with its border moved out by `distance`.
    #[must_use]
    pub fn grown(self, distance: f64) -> Self {
        Self { offset: self.offset + distance, ..self }
    }

    /// Where a box lies that is not empty. A touching box is never outside; NaN is across.
    #[inline]
    pub fn side_of(&self, bounds: &Aabb) -> Side {
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let (a, b) = (self.normal * min, self.normal * max);
        let lowest = a.min(b).element_sum() - self.offset;
        let highest = a.max(b).element_sum() - self.offset;
        if lowest > 0.0 {
            Side::Outside
        } else if highest <= 0.0 {
            Side::Inside
        } else {
            Side::Across
        }
    }

    fn is_finite(&self) -> bool {
        self.normal.is_finite() && self.offset.is_finite()
    }
}

/// Where a box lies to what is inside of all `planes`; an empty box is outside.
#[inline]
pub(super) fn side_of_all(planes: &[HalfSpace], bounds: &Aabb) -> Side {
    if bounds.is_empty() {
        return Side::Outside;
    }
    let mut all = Side::Inside;
    for plane in planes {
        match plane.side_of(bounds) {
            Side::Outside => return Side::Outside,
            Side::Across => all = Side::Across,
            Side::Inside => {}
        }
    }
    all
}

/// A face: its plane, and its corners counter-clockwise as seen from outside.
#[derive(Clone, Debug)]
struct Face {
    plane: HalfSpace,
    corners: Vec<DVec3>,
}

/// A convex polyhedron, perhaps empty.
#[derive(Clone, Debug, Default)]
pub struct Polyhedron {
    faces: Vec<Face>,
}

impl Polyhedron {
    /// The polyhedron without points.
    pub const EMPTY: Self = Self { faces: Vec::new() };

    /// A box grown by `margin` on all sides; empty for an empty box, and for one with NaN or infinite corners.
    pub fn from_box(bounds: Aabb, margin: f64) -> Self {
        if bounds.is_empty() || !(bounds.min.is_finite() && bounds.max.is_finite()) {
            return Self::EMPTY;
        }
        let (min, max) = (bounds.min.as_dvec3() - margin, bounds.max.as_dvec3() + margin);
        let corner = |i: usize| {
            DVec3::new(
                if i & 1 == 0 { min.x } else { max.x },
                if i & 2 == 0 { min.y } else { max.y },
                if i & 4 == 0 { min.z } else { max.z },
            )
        };
        let face = |normal: DVec3, offset, corners: [usize; 4]| Face {
            plane: HalfSpace { normal, offset },
            corners: corners.map(corner).to_vec(),
        };
        Self {
            faces: vec![
                face(DVec3::NEG_X, -min.x, [0, 4, 6, 2]),
                face(DVec3::X, max.x, [1, 3, 7, 5]),
                face(DVec3::NEG_Y, -min.y, [0, 1, 5, 4]),
                face(DVec3::Y, max.y, [2, 6, 7, 3]),
                face(DVec3::NEG_Z, -min.z, [0, 2, 3, 1]),
                face(DVec3::Z, max.z, [4, 5, 7, 6]),
            ],
        }
    }

    /// Cuts off what lies outside `plane`. A corner on the border stays; a plane that is not finite cuts
    /// nothing.
    pub fn clip(&mut self, plane: HalfSpace) {
        if !plane.is_finite() || self.vertices().all(|v| plane.height(v) <= 0.0) {
            return;
        }
        let mut cap = Vec::new();
        for face in &mut self.faces {
            face.corners = cut(&face.corners, plane, &mut cap);
        }
        self.faces.retain(|face| face.corners.len() >= 3);
        if self.faces.is_empty() {
            return;
        }
        let corners = around(cap, plane.normal);
        if corners.len() >= 3 {
            self.faces.push(Face { plane, corners });
        }
    }

    /// Whether there is no point in it.
    pub fn is_empty(&self) -> bool {
        self.faces.is_empty()
    }

    /// Corners; each comes once for every face it belongs to.
    pub fn vertices(&self) -> impl Iterator<Item = DVec3> + '_ {
        self.faces.iter().flat_map(|face| face.corners.iter().copied())
    }

    /// The half-spaces whose intersection it is.
    pub fn planes(&self) -> impl Iterator<Item = HalfSpace> + '_ {
        self.faces.iter().map(|face| face.plane)
    }

    /// Edges, each once.
    pub fn edges(&self) -> impl Iterator<Item = (DVec3, DVec3)> + '_ {
        let pairs = self.faces.iter().flat_map(|face| {
            let next = face.corners.iter().cycle().skip(1);
            face.corners.iter().copied().zip(next.copied())
        });
        // The two faces of an edge run along it in opposite directions.
        pairs.filter(|(a, b)| a.to_array() < b.to_array())
    }

    /// The largest `direction`·x over its points; −∞ if it is empty.
    pub fn support(&self, direction: DVec3) -> f64 {
        self.vertices().map(|v| direction.dot(v)).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Lower and upper corner of the smallest box around it; `None` if it is empty.
    pub fn extent(&self) -> Option<(DVec3, DVec3)> {
        self.vertices().map(|v| (v, v)).reduce(|(min, max), (v, _)| (min.min(v), max.max(v)))
    }

    /// The box around it, rounded to f32; empty for an empty one.
    pub fn bounds(&self) -> Aabb {
        let boxed = |(min, max): (DVec3, DVec3)| Aabb { min: min.as_vec3(), max: max.as_vec3() };
        self.extent().map_or(Aabb::EMPTY, boxed)
    }

    /// Whether a box may have a point in common with it: no plane of a face or side of the box tells them apart.
    /// Never false for a box that has one.
    pub fn intersects(&self, bounds: &Aabb) -> bool {
        let Some((min, max)) = self.extent() else { return false };
        !bounds.is_empty()
            && bounds.min.as_dvec3().cmple(max).all()
            && bounds.max.as_dvec3().cmpge(min).all()
            && self.planes().all(|plane| plane.side_of(bounds) != Side::Outside)
    }

    /// A polyhedron that holds every point within `distance` of this one: its planes moved out.
    #[must_use]
    pub fn grown(&self, distance: f64) -> Self {
        let Some((min, max)) = self.extent() else { return Self::EMPTY };
        let box_planes = [
            (DVec3::NEG_X, -min.x),
            (DVec3::X, max.x),
            (DVec3::NEG_Y, -min.y),
            (DVec3::Y, max.y),
            (DVec3::NEG_Z, -min.z),
            (DVec3::Z, max.z),
        ];
        // f32 holds no f64 box: start from one that is certainly larger.
        let outer = Aabb { min: min.as_vec3(), max: max.as_vec3() };
        let slack = f64::from(outer.magnitude()) * f64::from(f32::EPSILON) + f64::from(f32::MIN_POSITIVE);
        let mut grown = Self::from_box(outer, distance + slack);
        for (normal, offset) in box_planes {
            grown.clip(HalfSpace { normal, offset: offset + distance });
        }
        for plane in self.planes() {
            grown.clip(plane.grown(distance));
        }
        grown
    }

    /// Its volume in cubic scene units.
    pub fn volume(&self) -> f64 {
        let Some(apex) = self.vertices().next() else { return 0.0 };
        // Cones from a corner over the faces, in triangles.
        let cone = |face: &Face| {
            let fan = face.corners[1..].windows(2);
            fan.map(|pair| {
                let (a, b, c) = (face.corners[0] - apex, pair[0] - apex, pair[1] - apex);
                a.dot(b.cross(c)) / 6.0
            })
            .sum::<f64>()
        };
        self.faces.iter().map(cone).sum()
    }
}

/// The part of a convex polygon inside `plane`; its corners on the border are added to `border`.
fn cut(corners: &[DVec3], plane: HalfSpace, border: &mut Vec<DVec3>) -> Vec<DVec3> {
    let mut kept = Vec::with_capacity(corners.len() + 1);
    for (i, &b) in corners.iter().enumerate() {
        let a = corners[(i + corners.len() - 1) % corners.len()];
        let (height_a, height_b) = (plane.height(a), plane.height(b));
        if (height_a <= 0.0) != (height_b <= 0.0) {
            // From the inner end to the outer, whichever face asks: both faces of an edge get the same bits.
            let (inner, outer, low, high) =
                if height_a <= 0.0 { (a, b, height_a, height_b) } else { (b, a, height_b, height_a) };
            let crossing = inner + (outer - inner) * (low / (low - high));
            kept.push(crossing);
            border.push(crossing);
        }
        if height_b <= 0.0 {
            kept.push(b);
            if height_b == 0.0 {
                border.push(b);
            }
        }
    }
    kept.dedup();
    kept
}

/// Corners of a convex polygon in a plane with `normal`, counter-clockwise as seen from where it points.
fn around(mut corners: Vec<DVec3>, normal: DVec3) -> Vec<DVec3> {
    let middle = corners.iter().sum::<DVec3>() / corners.len().max(1) as f64;
    let (x, y) = normal.any_orthonormal_pair();
    let angle = |p: &DVec3| (*p - middle).dot(y).atan2((*p - middle).dot(x));
    // glam's pair is right-handed: x × y = normal.
    corners.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
    corners.dedup();
    corners
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use proptest::prelude::*;

    use super::*;

    const UNIT: Aabb = Aabb { min: Vec3::ZERO, max: Vec3::ONE };

    #[test]
    fn cutting_a_box_halves_its_volume() {
        let mut half = Polyhedron::from_box(UNIT, 0.0);
        assert!((half.volume() - 1.0).abs() < 1e-15);
        let normal = DVec3::ONE.normalize();
        half.clip(HalfSpace { normal, offset: normal.dot(DVec3::splat(0.5)) });
        assert!((half.volume() - 0.5).abs() < 1e-14, "{}", half.volume());
        // A hexagon is where it was cut.
        assert_eq!((half.planes().count(), half.edges().count()), (7, 15));
        half.clip(HalfSpace { normal: DVec3::X, offset: -0.1 });
        assert!(half.is_empty() && half.volume() == 0.0 && !half.intersects(&UNIT));
    }

    #[test]
    fn touching_is_not_outside() {
        let poly = Polyhedron::from_box(UNIT, 0.0);
        let beside = |x: f32| Aabb { min: Vec3::new(x, 0.0, 0.0), max: Vec3::new(x + 1.0, 1.0, 1.0) };
        assert!(poly.intersects(&beside(1.0)));
        assert!(!poly.intersects(&beside(1.0f32.next_up())));
        assert!(!poly.intersects(&Aabb::EMPTY));
    }

    #[test]
    fn odd_input_makes_no_trouble() {
        assert!(Polyhedron::from_box(Aabb::EMPTY, 1.0).is_empty());
        assert!(Polyhedron::from_box(Aabb { min: Vec3::ZERO, max: Vec3::INFINITY }, 0.0).is_empty());
        let mut poly = Polyhedron::from_box(UNIT, 0.0);
        poly.clip(HalfSpace { normal: DVec3::NAN, offset: 0.0 });
        assert_eq!(poly.volume(), 1.0);
        let huge = Polyhedron::from_box(Aabb { min: Vec3::MIN, max: Vec3::MAX }, 0.0);
        assert!(huge.volume().is_finite());
    }

    fn direction() -> impl Strategy<Value = DVec3> {
        (-1.0..1.0, -1.0..1.0, -1.0..1.0)
            .prop_filter_map("no direction", |(x, y, z)| DVec3::new(x, y, z).try_normalize())
    }

    proptest! {
        /// A point inside all planes is inside whatever clipping leaves, and so is any box around it.
        #[test]
        fn clipping_loses_no_point(
            planes in prop::collection::vec((direction(), -0.5..1.5), 0..12),
            point in prop::array::uniform3(0.0f32..1.0),
        ) {
            let point = Vec3::from_array(point);
            let mut poly = Polyhedron::from_box(UNIT, 0.0);
            let mut inside = true;
            for (normal, offset) in planes {
                let plane = HalfSpace { normal, offset };
                poly.clip(plane);
                inside &= plane.height(point.as_dvec3()) <= 0.0;
            }
            let at = Aabb { min: point, max: point };
            prop_assert!(!inside || poly.grown(1e-12).intersects(&at));
            if inside {
                // Support in any direction reaches the point.
                for d in [DVec3::X, DVec3::NEG_Y, DVec3::ONE, DVec3::new(-1.0, 2.0, -3.0)] {
                    prop_assert!(poly.support(d) >= d.dot(point.as_dvec3()) - 1e-12);
                }
            }
        }
    }
}
