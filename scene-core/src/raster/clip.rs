//! Clipping in homogeneous coordinates, against the plane of the eye and the guard band.
//!
//! Neighbours stay watertight: the point where an edge leaves a plane is computed from its inner end to its
//! outer end, so that both triangles of the edge find the same point, and all cuts but those at the eye lie
//! far outside the target. Near and far planes are not cut here but tested pixel by pixel.

use glam::{DVec4, Vec3};

use super::draw::Frame;
use super::projection::{GUARD_MAX, GUARD_MIN, MIN_W, Projection};

/// A triangle ready for filling, with nearness in f64 since a corner close to the eye has a huge one.
#[derive(Clone, Copy, Debug)]
pub(super) struct FlatTriangle {
    /// Snapped x of the corners.
    pub(super) x: [i32; 3],
    /// Snapped y of the corners.
    pub(super) y: [i32; 3],
    /// Nearness of the corners.
    pub(super) nearness: [f64; 3],
    /// The triangle of the scene it is part of.
    pub(super) id: u32,
}

impl FlatTriangle {
    /// A triangle that needs no clipping.
    #[inline(always)]
    pub(super) fn whole(frame: &Frame<'_>, id: u32) -> Self {
        let corners = frame.scene.triangles()[id as usize].map(|i| frame.vertices[i as usize]);
        Self {
            x: corners.map(|c| c[0]),
            y: corners.map(|c| c[1]),
            nearness: corners.map(|c| f64::from(f32::from_bits(c[2] as u32))),
            id,
        }
    }
}

/// Corners a clipped triangle can have: each of the five planes adds at most one.
const MAX_CORNERS: usize = 8;

/// A convex polygon on the stack.
#[derive(Clone, Copy)]
struct Polygon {
    corners: [DVec4; MAX_CORNERS],
    len: usize,
}

impl Polygon {
    const EMPTY: Self = Self { corners: [DVec4::ZERO; MAX_CORNERS], len: 0 };

    fn push(&mut self, corner: DVec4) {
        // A polygon made non-convex by rounding may cross a plane more often than twice; what would not fit
        // is far outside the target.
        if let Some(slot) = self.corners.get_mut(self.len) {
            *slot = corner;
            self.len += 1;
        }
    }

    /// The part where `distance` is not negative. NaN counts as outside.
    fn clip(&self, distance: impl Fn(DVec4) -> f64) -> Self {
        let mut kept = Self::EMPTY;
        for i in 0..self.len {
            let (a, b) = (self.corners[i], self.corners[(i + 1) % self.len]);
            let (da, db) = (distance(a), distance(b));
            let (a_inside, b_inside) = (da >= 0.0, db >= 0.0);
            if a_inside {
                kept.push(a);
            }
            if a_inside != b_inside {
                kept.push(if a_inside {
                    a + (b - a) * (da / (da - db))
                } else {
                    b + (a - b) * (db / (db - da))
                });
            }
        }
        kept
    }
}

/// Clips a triangle given in world space and hands on what is left of it, as a fan.
pub(super) fn clip_triangle(
    projection: &Projection,
    corners: [Vec3; 3],
    id: u32,
    mut emit: impl FnMut(FlatTriangle),
) {
    let mut polygon = Polygon::EMPTY;
    for corner in corners {
        polygon.push(projection.homogeneous(corner));
    }
    polygon = polygon.clip(|p| p.w - MIN_W);
    // The cut may have been rounded to the wrong side of zero, where it would be mirrored.
    for corner in &mut polygon.corners[..polygon.len] {
        corner.w = corner.w.max(MIN_W);
    }
    polygon = polygon.clip(|p| p.x - GUARD_MIN * p.w);
    polygon = polygon.clip(|p| GUARD_MAX * p.w - p.x);
    polygon = polygon.clip(|p| p.y - GUARD_MIN * p.w);
    polygon = polygon.clip(|p| GUARD_MAX * p.w - p.y);
    let snapped = |i: usize| Projection::snap_clipped(polygon.corners[i]);
    for i in 1..polygon.len.saturating_sub(1) {
        let fan = [snapped(0), snapped(i), snapped(i + 1)];
        emit(FlatTriangle { x: fan.map(|c| c.0), y: fan.map(|c| c.1), nearness: fan.map(|c| c.2), id });
    }
}

#[cfg(test)]
mod tests {
    use glam::dcamera::rh::proj::directx::perspective;

    use super::*;

    fn clipped(corners: [Vec3; 3]) -> Vec<FlatTriangle> {
        let projection = Projection::new(&perspective(1.0, 1.0, 0.1, 100.0), 64, 64, false);
        let mut out = Vec::new();
        clip_triangle(&projection, corners, 7, |t| out.push(t));
        out
    }

    #[test]
    fn a_triangle_behind_the_eye_vanishes() {
        assert!(clipped([Vec3::Z, Vec3::new(1.0, 0.0, 2.0), Vec3::new(0.0, 1.0, 3.0)]).is_empty());
    }

    #[test]
    fn cuts_stay_inside_the_guard_band_for_huge_coordinates() {
        let huge = 1e30;
        let parts =
            clipped([Vec3::new(-huge, -1.0, huge), Vec3::new(huge, -1.0, huge), Vec3::new(0.0, -1.0, -huge)]);
        assert!(!parts.is_empty());
        for part in parts {
            assert_eq!(part.id, 7);
            for v in part.x.into_iter().chain(part.y) {
                assert!((-4_194_304..=8_388_608).contains(&v), "{v}");
            }
            assert!(part.nearness.iter().all(|n| n.is_finite()));
        }
    }

    #[test]
    fn both_triangles_of_an_edge_are_cut_at_the_same_points() {
        let (a, b) = (Vec3::new(-3.0, 0.3, -5.0), Vec3::new(1.0, 0.1, 2.0));
        let one = clipped([a, b, Vec3::new(0.0, 5.0, -5.0)]);
        let two = clipped([b, a, Vec3::new(0.0, -5.0, -5.0)]);
        let points = |parts: &[FlatTriangle]| {
            let mut all: Vec<_> = parts.iter().flat_map(|t| t.x.into_iter().zip(t.y)).collect();
            all.sort_unstable();
            all.dedup();
            all
        };
        let (one, two) = (points(&one), points(&two));
        assert_eq!(one.iter().filter(|p| two.contains(p)).count(), 2);
    }
}
