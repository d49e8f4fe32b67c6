//! Axis-aligned bounding boxes.

use glam::Vec3;

/// An axis-aligned box, closed on all sides. An empty box has `min > max` and unites neutrally.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Lower corner.
    pub min: Vec3,
    /// Upper corner.
    pub max: Vec3,
}

impl Aabb {
    /// The box that contains nothing.
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// The smallest box around `points`; [`Aabb::EMPTY`] for none. A NaN coordinate is ignored.
    pub fn from_points(points: impl IntoIterator<Item = Vec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, |bounds, point| bounds.with_point(point))
    }

    /// This box, grown to hold `point`.
    #[must_use]
    pub fn with_point(self, point: Vec3) -> Self {
        Self { min: self.min.min(point), max: self.max.max(point) }
    }

    /// The smallest box around both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Whether the box holds no point at all.
    pub fn is_empty(&self) -> bool {
        !(self.min.cmple(self.max).all())
    }

    /// What both hold.
    #[must_use]
    pub fn intersection(self, other: Self) -> Self {
        Self { min: self.min.max(other.min), max: self.max.min(other.max) }
    }

    /// Whether all of `other` lies in this box. An empty one does.
    pub fn holds(&self, other: &Self) -> bool {
        other.is_empty() || (self.min.cmple(other.min) & other.max.cmple(self.max)).all()
    }

    /// The middle of the box; NaN for an empty one.
    pub fn center(&self) -> Vec3 {
        self.min * 0.5 + self.max * 0.5
    }

    /// Edge lengths; zero for an empty box.
    pub fn size(&self) -> Vec3 {
        if self.is_empty() { Vec3::ZERO } else { self.max - self.min }
    }

    /// Length of the diagonal; zero for an empty box.
    pub fn diagonal(&self) -> f32 {
        self.size().length()
    }

    /// The largest absolute coordinate: what floating-point error bounds scale with. Zero for an empty box.
    pub fn magnitude(&self) -> f32 {
        if self.is_empty() { 0.0 } else { self.min.abs().max(self.max.abs()).max_element() }
    }

    /// The eight corners; bit 0, 1, 2 of the index choose the upper x, y, z.
    pub fn corners(&self) -> [Vec3; 8] {
        std::array::from_fn(|i| {
            let upper = |bit: usize| i >> bit & 1 == 1;
            Vec3::new(
                if upper(0) { self.max.x } else { self.min.x },
                if upper(1) { self.max.y } else { self.min.y },
                if upper(2) { self.max.z } else { self.min.z },
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn empty_box_unites_neutrally() {
        let unit = Aabb::from_points([Vec3::ZERO, Vec3::ONE]);
        assert_eq!(Aabb::EMPTY.union(unit), unit);
        assert!(Aabb::EMPTY.is_empty() && !unit.is_empty());
        assert_eq!(Aabb::EMPTY.diagonal(), 0.0);
        assert_eq!(Aabb::EMPTY.magnitude(), 0.0);
    }

    #[test]
    fn a_box_holds_what_it_has_in_common_with_another() {
        let [a, b] = [Vec3::ZERO, Vec3::new(1.0, -1.0, 0.5)].map(|at| Aabb { min: at, max: at + 2.0 });
        let both = a.intersection(b);
        assert_eq!(both, Aabb { min: Vec3::new(1.0, 0.0, 0.5), max: Vec3::new(2.0, 1.0, 2.0) });
        assert!(a.holds(&both) && b.holds(&both) && a.holds(&a) && !a.holds(&b));
        let apart = Aabb { min: Vec3::splat(5.0), max: Vec3::splat(6.0) };
        assert!(a.intersection(apart).is_empty() && a.holds(&a.intersection(apart)));
    }

    #[test]
    fn corners_span_the_box() {
        let bounds = Aabb { min: Vec3::new(-1.0, 2.0, 3.0), max: Vec3::new(4.0, 5.0, 6.0) };
        assert_eq!(Aabb::from_points(bounds.corners()), bounds);
    }
}
