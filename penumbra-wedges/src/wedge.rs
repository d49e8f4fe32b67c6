//! Penumbra wedges: where an edge lies between a receiver and some point of the light. Szabó, 7.3 and 7.6.
//!
//! Receivers p that see a point q of the light Λ through a point y of the edge e are p = y + σ(y − q) with σ ≥ 0. All of
//! them form one convex set, the *wedge*: written homogeneously, (p, 1) = (1 + σ)(y, 1) − σ(q, 1), which is the part of
//! weight 1 of the convex cone over e and −Λ. Its half-spaces are those of all planes that separate the edge from the light:
//!
//! > n·x ≥ min(n·a, n·b) =: k  for every n with n·q ≤ k for all q in Λ,
//!
//! since n·p = n·y + σ(n·y − n·q) ≥ k. Any choice of such planes encloses the wedge. Taken are
//! * the **front** and the **back** plane, which hold the edge and touch the light;
//! * **side** planes through either end that touch the light: for a ball the one whose normal lies in the plane of edge and
//!   light's middle, for a flat light (7.6, *narrow wedges*) the two along sides of the light that bound the wedge most;
//! * the plane before the edge across the way to the light, which leaves out what is between the two.
//!
//! # Edges that point at the light or cross it
//! The published wedges move the ends of such edges, or drop them, since a plane that holds the edge and touches the light
//! does not exist. Here each plane is asked whether it separates the two, and one that does not is left out. A wedge with
//! fewer planes is wider, never narrower: nothing that casts a shadow is lost, and no wedge is turned inside out. An edge
//! that crosses the light has no plane and is everywhere.

use glam::DVec3;

use crate::area_light::{AreaLight, LightShape};

/// Half-spaces of a wedge at most: one a lane.
pub const LANES: usize = 8;

/// What rounding may do to a product of a normal and a way, relative to their lengths: some ten operations of 2⁻⁵³ each
/// on ways that are themselves differences of f32; 2⁻⁴⁴ is fifty times that. A plane that misses the light by so little
/// cuts off receivers that see the edge at the light's very rim, where no sample lies.
const SLACK: f64 = 1.0 / 17_592_186_044_416.0;

/// Share of its terms that n·p + k may lose in f32. Each factor and each product is rounded, and each sum of four: eight times 2⁻²⁴.
/// What is taken off is twice that.
const ROUNDING: f64 = 1.0 / 1_048_576.0;

/// The half-spaces n·x + k ≥ 0 around a wedge, a lane each; a lane of zeros holds everything. In f32, two cache lines long, for
/// there may be hundreds of thousands, which are asked over and over: what is within rounding of a border counts as inside.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub struct Wedge {
    /// x, y and z of the normals, of unit length, then k.
    planes: [[f32; LANES]; 4],
}

impl Wedge {
    /// The wedge of the edge from `a` to `b`.
    pub fn new(light: &AreaLight, a: DVec3, b: DVec3) -> Self {
        let mut builder = Builder { light, a, b, wedge: Self { planes: [[0.0; LANES]; 4] }, used: 0 };
        let edge = b - a;
        builder.add(-light.from_point((a + b) * 0.5));
        match light.shape {
            LightShape::Rect { center, half: [x, y] } => {
                builder.add_flat(&[center - x - y, center + x - y, center + x + y, center - x + y]);
            }
            LightShape::Disk { center, half: [x, y] } => {
                // An octagon around the disk.
                let reach = std::f64::consts::FRAC_PI_8.cos().recip();
                let corner = |i: usize| {
                    let (sin, cos) = (i as f64 * std::f64::consts::FRAC_PI_4).sin_cos();
                    center + (x * cos + y * sin) * reach
                };
                builder.add_flat::<8>(&std::array::from_fn(corner));
            }
            LightShape::Ball { radius, .. } => builder.add_round(edge, |way| radius / way.length()),
            LightShape::Cone { angle, .. } => builder.add_round(edge, |_| angle.sin()),
        }
        builder.wedge
    }

    /// The intersection of half-spaces, each with a normal and a point on its border; those past the eighth and those without a
    /// direction are left out.
    pub fn of_planes(planes: impl IntoIterator<Item = (DVec3, DVec3)>) -> Self {
        let mut wedge = Self { planes: [[0.0; LANES]; 4] };
        let with_direction =
            planes.into_iter().filter_map(|(n, through)| Some((n.try_normalize()?, through)));
        for (lane, (n, through)) in with_direction.take(LANES).enumerate() {
            wedge.set(lane, n, through);
        }
        wedge
    }

    fn set(&mut self, lane: usize, n: DVec3, through: DVec3) {
        let k = SLACK * (n.abs() * through.abs()).element_sum() - n.dot(through);
        for (plane, value) in self.planes.iter_mut().zip([n.x, n.y, n.z, k + k.abs() * ROUNDING]) {
            plane[lane] = value as f32;
        }
    }

    /// How many half-spaces bound it.
    pub fn plane_count(&self) -> usize {
        (0..LANES).filter(|&lane| (0..3).any(|axis| self.planes[axis][lane] != 0.0)).count()
    }

    /// Whether a point lies inside.
    #[inline(always)]
    pub fn holds(&self, point: DVec3) -> bool {
        self.touches(point, DVec3::ZERO)
    }

    /// Whether a box, by its middle and half size, may have a point inside.
    #[inline(always)]
    pub fn touches(&self, center: DVec3, half: DVec3) -> bool {
        let half = (half + (center.abs() + half) * ROUNDING).as_vec3();
        let center = center.as_vec3();
        let [x, y, z, k] = &self.planes;
        let mut inside = true;
        for lane in 0..LANES {
            let middle = x[lane] * center.x + y[lane] * center.y + z[lane] * center.z + k[lane];
            let reach = x[lane].abs() * half.x + y[lane].abs() * half.y + z[lane].abs() * half.z;
            inside &= middle + reach >= 0.0;
        }
        inside
    }
}

struct Builder<'a> {
    light: &'a AreaLight,
    a: DVec3,
    b: DVec3,
    wedge: Wedge,
    used: usize,
}

impl Builder<'_> {
    /// Adds the half-space with the normal `n`, if that separates edge and light.
    fn add(&mut self, n: DVec3) {
        if self.used < LANES
            && let Some(n) = self.separating(n)
        {
            let through = if n.dot(self.b - self.a) < 0.0 { self.b } else { self.a };
            self.wedge.set(self.used, n, through);
            self.used += 1;
        }
    }

    /// The unit normal, if its plane through the nearer end has the light below.
    fn separating(&self, n: DVec3) -> Option<DVec3> {
        let n = n.try_normalize()?;
        let through = if n.dot(self.b - self.a) < 0.0 { self.b } else { self.a };
        self.light.is_below(n, through, SLACK).then_some(n)
    }

    /// Planes that touch a flat light, given by the corners around it.
    fn add_flat<const N: usize>(&mut self, corners: &[DVec3; N]) {
        let (a, b) = (self.a, self.b);
        // Of the planes through the edge only two can touch the light; where a corner is hit by two, twice the same.
        let (mut front, mut back) = (None, None);
        for &corner in corners {
            let n = (b - a).cross(corner - a);
            front = front.or_else(|| self.separating(n));
            back = back.or_else(|| self.separating(-n));
        }
        [front, back].into_iter().flatten().for_each(|n| self.add(n));
        for (end, other) in [(a, b), (b, a)] {
            let along = other - end;
            let mut sides: Vec<(f64, DVec3)> = Vec::new();
            for (i, &corner) in corners.iter().enumerate() {
                let n = (corner - end).cross(corners[(i + 1) % N] - end);
                let both = [n, -n].into_iter().filter_map(|n| self.separating(n));
                sides.extend(both.map(|n| (n.dot(along), n)).filter(|(aligned, _)| *aligned > 0.0));
            }
            sides.sort_by(|x, y| y.0.total_cmp(&x.0));
            sides.iter().take(2).for_each(|(_, n)| self.add(*n));
        }
    }

    /// Planes that touch a round light; `sin` is that of half the angle under which it is seen at the end of a way.
    ///
    /// A unit normal n touches if n·w = sin for the unit vector w away from the light. Those across the edge e are
    /// sin/d · c ± √(1 − sin²/d²) · (ê × c), c the unit vector along the part of w across e and d its length; the side plane's is
    /// sin · w + √(1 − sin²) · g, g the unit vector along the part of e across w.
    fn add_round(&mut self, edge: DVec3, sin: impl Fn(DVec3) -> f64) {
        let Some(along) = edge.try_normalize() else { return };
        for (end, along) in [(self.a, along), (self.b, -along)] {
            let away = -self.light.from_point(end);
            let sin = sin(away);
            let Some(away) = away.try_normalize() else { continue };
            // The same front and back plane from either end: the first does.
            if along.dot(edge) > 0.0 {
                let across = away - along * away.dot(along);
                let ratio = sin / across.length();
                if let Some(across) = across.try_normalize().filter(|_| ratio < 1.0) {
                    let root = (1.0 - ratio * ratio).sqrt();
                    let turned = along.cross(across);
                    self.add(across * ratio + turned * root);
                    self.add(across * ratio - turned * root);
                }
            }
            let beside = along - away * along.dot(away);
            if let Some(beside) = beside.try_normalize().filter(|_| sin < 1.0) {
                self.add(away * sin + beside * (1.0 - sin * sin).sqrt());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use proptest::prelude::*;
    use scene_core::Light;

    use super::*;

    fn lights(center: Vec3) -> [AreaLight; 4] {
        [
            Light::Rect { center, half_u: Vec3::new(0.5, 0.1, 0.0), half_v: Vec3::new(0.0, 0.2, 0.4) },
            Light::Disk { center, normal: Vec3::new(0.2, -1.0, 0.1), radius: 0.5 },
            Light::Sphere { center, radius: 0.5 },
            Light::Directional { direction: center, angular_radius: 0.3 },
        ]
        .map(|light| AreaLight::new(&light).expect("extended"))
    }

    /// A point of the light, or a direction towards it, for (u, v) in the unit disk.
    fn point_of(light: &AreaLight, u: f64, v: f64) -> (DVec3, bool) {
        match light.shape {
            LightShape::Rect { center, half: [x, y] } | LightShape::Disk { center, half: [x, y] } => {
                (center + x * u + y * v, true)
            }
            LightShape::Ball { center, radius } => (center + DVec3::new(u, v, 0.3 * u) * radius * 0.9, true),
            LightShape::Cone { axis, angle } => {
                let (x, y) = axis.any_orthonormal_pair();
                (axis + (x * u + y * v) * angle.tan(), false)
            }
        }
    }

    /// What sees a point of the light through the edge's place `t`, `sigma` times as far behind it.
    fn behind(light: &AreaLight, [a, b]: [DVec3; 2], [u, v]: [f64; 2], [t, sigma]: [f64; 2]) -> DVec3 {
        let (q, at_place) = point_of(light, u, v);
        let y = a + (b - a) * t;
        if at_place { y + (y - q) * sigma } else { y - q * sigma }
    }

    proptest! {
        /// Whatever sees the light through the edge is inside, edges across the light included.
        #[test]
        fn receivers_behind_the_edge_are_inside(
            center in prop::array::uniform3(-1.0_f32..1.0),
            ends in prop::array::uniform6(-2.0_f64..2.0),
            (u, v) in (-0.7_f64..0.7, -0.7_f64..0.7),
            (t, sigma) in (0.0_f64..1.0, 0.0_f64..50.0),
        ) {
            let (a, b) = (DVec3::from_slice(&ends[..3]), DVec3::from_slice(&ends[3..]));
            for light in lights(Vec3::from_array(center)) {
                let wedge = Wedge::new(&light, a, b);
                let p = behind(&light, [a, b], [u, v], [t, sigma]);
                prop_assert!(wedge.holds(p), "{light:?}, {a} {b}, {p}");
                prop_assert!(wedge.touches(p + 0.1, DVec3::splat(0.1001)));
            }
        }
    }

    proptest! {
        /// The same a thousand lights away from zero, where f32 loses most of the digits between them.
        #[test]
        fn rounding_far_from_zero_leaves_nothing_out(
            away in prop::array::uniform3(-1000.0_f32..1000.0),
            ends in prop::array::uniform6(-2.0_f64..2.0),
            (u, v) in (-0.7_f64..0.7, -0.7_f64..0.7),
            // On the edge itself, where its planes meet, every digit counts.
            (t, sigma) in (0.0_f64..1.0, prop_oneof![Just(0.0_f64), 0.0_f64..50.0]),
        ) {
            let away = Vec3::from_array(away);
            let (a, b) = (DVec3::from_slice(&ends[..3]), DVec3::from_slice(&ends[3..]));
            let (a, b) = (a + away.as_dvec3(), b + away.as_dvec3());
            for light in lights(away).into_iter().take(3) {
                let wedge = Wedge::new(&light, a, b);
                let p = behind(&light, [a, b], [u, v], [t, sigma]);
                prop_assert!(wedge.holds(p), "{light:?}, {a} {b}, {p}");
            }
        }
    }

    #[test]
    fn wedges_are_bounded_on_all_sides() {
        let (a, b) = (DVec3::new(-1.0, 1.0, 0.0), DVec3::new(1.0, 1.0, 0.0));
        for light in lights(Vec3::new(0.0, 5.0, 0.0)).into_iter().take(3) {
            let wedge = Wedge::new(&light, a, b);
            assert!(wedge.plane_count() >= 5, "{light:?}");
            assert!(wedge.holds(DVec3::ZERO));
            // In the umbra's and the lit side, beside both ends, and between edge and light.
            for outside in [
                DVec3::new(0.0, 0.0, 0.5),
                DVec3::new(0.0, 0.0, -0.5),
                DVec3::new(1.6, 0.0, 0.0),
                DVec3::new(-1.6, 0.0, 0.0),
                DVec3::new(0.0, 1.2, 0.0),
            ] {
                assert!(!wedge.holds(outside), "{light:?} {outside}");
                assert!(!wedge.touches(outside, DVec3::splat(0.01)));
            }
        }
    }

    #[test]
    fn an_edge_across_the_light_is_everywhere() {
        for light in lights(Vec3::new(0.0, 5.0, 0.0)).into_iter().take(3) {
            let wedge = Wedge::new(&light, DVec3::new(-3.0, 4.9, -0.1), DVec3::new(3.0, 5.1, 0.1));
            assert!(wedge.holds(DVec3::splat(-7.0)) && wedge.holds(DVec3::splat(9.0)), "{light:?}");
        }
    }
}
