//! Which side of a triangle a light sees: decided exactly.
//!
//! Facing decides topology: where the two faces of an edge disagree, a shadow volume gets a side. It must not
//! depend on which corner a triangle starts with, or duplicate and flipped faces would tear the volume. So
//! the sign is that of the exact determinant of the f32 input: an f64 filter answers nearly always, and what
//! it cannot prove is left to exact arithmetic (Shewchuk, "Adaptive Precision Floating-Point Arithmetic and
//! Fast Robust Geometric Predicates", 1997).

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use robust::{Coord3D, orient3d};

use crate::light::LightPoint;

/// Triangles a task; smaller work is done by the calling thread.
const CHUNK: usize = 1 << 14;

/// The facing of a triangle: +1 if `light` sees its corners counter-clockwise (its normal
/// (b−a) × (c−a) points to the light's side), −1 if clockwise, and 0 if the light lies in its plane or the
/// triangle has no area. Exact for finite input; a NaN gives 0.
///
/// A light at infinity is the homogeneous point (d, 0): only the direction's sign matters, not its length.
#[inline]
pub fn facing_of([a, b, c]: [Vec3; 3], light: LightPoint) -> i8 {
    let [a, b, c] = [a, b, c].map(Vec3::as_dvec3);
    let (u, v) = (b - a, c - a);
    let w = match light {
        LightPoint::At(p) => p.as_dvec3() - a,
        LightPoint::Towards(d) => d.as_dvec3(),
    };
    let (u_zx, u_xy, u_yz) = (u.z * v.x, u.x * v.y, u.y * v.z);
    let (v_zx, v_xy, v_yz) = (u.x * v.z, u.y * v.x, u.z * v.y);
    let det = w.x * (u_yz - v_yz) + w.y * (u_zx - v_zx) + w.z * (u_xy - v_xy);
    let permanent = w.x.abs() * (u_yz.abs() + v_yz.abs())
        + w.y.abs() * (u_zx.abs() + v_zx.abs())
        + w.z.abs() * (u_xy.abs() + v_xy.abs());
    // Shewchuk's bound for `orient3d`, (7 + 56ε)ε·permanent with ε = 2⁻⁵³: the same operations in the same
    // order. A direction is exact where a difference was rounded, so it holds there too. Products of three
    // differences of f32 neither overflow nor underflow in f64.
    let bound = (7.0 + 28.0 * f64::EPSILON) * (0.5 * f64::EPSILON) * permanent;
    if det > bound {
        1
    } else if det < -bound {
        -1
    } else {
        exact_facing(a, b, c, light)
    }
}

/// [`facing_of`] of every triangle, in parallel.
///
/// # Panics
/// If a triangle refers to a vertex that does not exist; [`Scene`](crate::Scene) holds no such triangle.
pub fn facing(positions: &[Vec3], triangles: &[[u32; 3]], light: LightPoint) -> Vec<i8> {
    let mut facing = vec![0; triangles.len()];
    facing.par_chunks_mut(CHUNK).zip(triangles.par_chunks(CHUNK)).for_each(|(facing, triangles)| {
        for (facing, triangle) in facing.iter_mut().zip(triangles) {
            *facing = facing_of(triangle.map(|i| positions[i as usize]), light);
        }
    });
    facing
}

#[cold]
fn exact_facing(a: DVec3, b: DVec3, c: DVec3, light: LightPoint) -> i8 {
    let coord = |p: DVec3| Coord3D { x: p.x, y: p.y, z: p.z };
    match light {
        // `orient3d` is positive where the point lies below the counter-clockwise side.
        LightPoint::At(p) => sign(-orient3d(coord(a), coord(b), coord(c), coord(p.as_dvec3()))),
        LightPoint::Towards(d) => sign_towards(a, b, c, d.as_dvec3()),
    }
}

/// The exact sign of d · (a×b + b×c + c×a), which is d · ((b−a) × (c−a)) without differences to round.
fn sign_towards(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> i8 {
    let mut sum = Expansion::default();
    for (p, q) in [(a, b), (b, c), (c, a)] {
        for (k, y, z) in
            [(d.x, [p.y, q.y], [p.z, q.z]), (d.y, [p.z, q.z], [p.x, q.x]), (d.z, [p.x, q.x], [p.y, q.y])]
        {
            // Two f32 factors make at most 48 bits, so the inner product is exact in f64.
            sum.add_product(k, y[0] * z[1]);
            sum.add_product(-k, z[0] * y[1]);
        }
    }
    sum.sign()
}

/// A sum of f64 kept exactly, as non-overlapping parts of growing magnitude.
struct Expansion {
    /// 18 products of two parts each grow the expansion by at most one part a time.
    parts: [f64; 36],
    len: usize,
}

impl Default for Expansion {
    fn default() -> Self {
        Self { parts: [0.0; 36], len: 0 }
    }
}

impl Expansion {
    /// Adds x·y, split exactly into its rounded value and the error of that rounding.
    fn add_product(&mut self, x: f64, y: f64) {
        let product = x * y;
        self.add(x.mul_add(y, -product));
        self.add(product);
    }

    /// Shewchuk's GROW-EXPANSION with zero elimination.
    fn add(&mut self, value: f64) {
        let (mut carry, mut kept) = (value, 0);
        for i in 0..self.len {
            let part = self.parts[i];
            let sum = carry + part;
            let part_of_sum = sum - carry;
            let error = (carry - (sum - part_of_sum)) + (part - part_of_sum);
            carry = sum;
            if error != 0.0 {
                self.parts[kept] = error;
                kept += 1;
            }
        }
        if carry != 0.0 {
            self.parts[kept] = carry;
            kept += 1;
        }
        self.len = kept;
    }

    /// The largest part outweighs all others together.
    fn sign(&self) -> i8 {
        self.len.checked_sub(1).map_or(0, |last| sign(self.parts[last]))
    }
}

fn sign(x: f64) -> i8 {
    i8::from(x > 0.0) - i8::from(x < 0.0)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const TRIANGLE: [Vec3; 3] = [Vec3::ZERO, Vec3::X, Vec3::Y];

    #[test]
    fn counter_clockwise_is_positive() {
        for (z, expected) in [(2.0, 1), (-2.0, -1), (0.0, 0)] {
            assert_eq!(facing_of(TRIANGLE, LightPoint::At(Vec3::new(0.3, 9.0, z))), expected);
            assert_eq!(facing_of(TRIANGLE, LightPoint::Towards(Vec3::new(0.3, 0.9, z))), expected);
        }
    }

    #[test]
    fn broken_input_faces_nowhere() {
        assert_eq!(facing_of(TRIANGLE, LightPoint::At(Vec3::NAN)), 0);
        assert_eq!(facing_of([Vec3::NAN; 3], LightPoint::Towards(Vec3::Y)), 0);
        assert_eq!(facing_of([Vec3::ZERO, Vec3::X, Vec3::X * 3.0], LightPoint::At(Vec3::ONE)), 0);
    }

    #[test]
    fn one_ulp_off_the_plane_is_seen_and_the_plane_itself_is_not() {
        // A slanted plane x + y + z = 3 far from the origin's precision.
        let corners = [Vec3::new(3e7, -3e7, 3.0), Vec3::new(-3e7, 3.0, 3e7), Vec3::new(3.0, 3e7, -3e7)];
        let on = Vec3::new(1.0, 1.0, 1.0);
        let above = Vec3::new(1.0, 1.0, 1.0 + f32::EPSILON);
        let below = Vec3::new(1.0, 1.0, 1.0 - f32::EPSILON);
        let facing_at = |p| facing_of(corners, LightPoint::At(p));
        assert_eq!(facing_at(on), 0);
        assert_eq!(facing_at(above), -facing_at(below));
        assert_ne!(facing_at(above), 0);
        // In the plane's own directions a light at infinity grazes it.
        assert_eq!(facing_of(corners, LightPoint::Towards(Vec3::new(1.0, -1.0, 0.0))), 0);
        assert_eq!(facing_of(corners, LightPoint::Towards(Vec3::new(1.0, -1.0, 1e-30))), facing_at(above));
    }

    fn int_point(range: i32) -> impl Strategy<Value = [i32; 3]> {
        prop::array::uniform3(-range..=range)
    }

    fn vec(p: [i32; 3]) -> Vec3 {
        Vec3::from_array(p.map(|x| x as f32))
    }

    fn exact(rows: [[i128; 3]; 3]) -> i8 {
        let [u, v, w] = rows;
        let det = w[0] * (u[1] * v[2] - u[2] * v[1])
            + w[1] * (u[2] * v[0] - u[0] * v[2])
            + w[2] * (u[0] * v[1] - u[1] * v[0]);
        det.signum() as i8
    }

    proptest! {
        #[test]
        fn signs_equal_integer_arithmetic(
            range in prop::sample::select(vec![2, 100, 1 << 24]),
            seed in prop::array::uniform4(int_point(1 << 24)),
        ) {
            let [a, b, c, p] = seed.map(|q| q.map(|x| x % (range + 1)));
            let sub = |q: [i32; 3], r: [i32; 3]| std::array::from_fn(|i| i128::from(q[i] - r[i]));
            let corners = [vec(a), vec(b), vec(c)];
            let at = exact([sub(b, a), sub(c, a), sub(p, a)]);
            let towards = exact([sub(b, a), sub(c, a), sub(p, [0; 3])]);
            prop_assert_eq!(facing_of(corners, LightPoint::At(vec(p))), at);
            prop_assert_eq!(facing_of(corners, LightPoint::Towards(vec(p))), towards);
            // The exact path alone, which the filter mostly hides.
            let [da, db, dc] = corners.map(Vec3::as_dvec3);
            prop_assert_eq!(exact_facing(da, db, dc, LightPoint::At(vec(p))), at);
            prop_assert_eq!(exact_facing(da, db, dc, LightPoint::Towards(vec(p))), towards);
        }

        #[test]
        fn the_start_corner_does_not_matter_and_a_flip_negates(
            bits in prop::array::uniform12(any::<f32>().prop_filter("finite", |x| x.is_finite())),
            coplanar in any::<bool>(),
        ) {
            let v = |i: usize| Vec3::new(bits[i], bits[i + 1], bits[i + 2]);
            let (a, b, c) = (v(0), v(3), v(6));
            let target = if coplanar { c } else { v(9) };
            for light in [LightPoint::At(target), LightPoint::Towards(target)] {
                let facing = facing_of([a, b, c], light);
                prop_assert_eq!(facing_of([b, c, a], light), facing);
                prop_assert_eq!(facing_of([c, a, b], light), facing);
                prop_assert_eq!(facing_of([b, a, c], light), -facing);
            }
        }
    }
}
