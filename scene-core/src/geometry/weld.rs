//! Welding: vertices at the very same position become one.
//!
//! Loaders and exporters split vertices along seams of normals and texture coordinates; topology must not see
//! those seams. Only bitwise equal positions are welded (with −0 equal to +0), so welding never moves a
//! point, needs no tolerance, and gives the same result at any scale.

use glam::Vec3;
use rayon::prelude::*;

/// Which vertices share a position.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Weld {
    /// For each vertex the first vertex at its position. It is an index into the very array that was welded,
    /// so positions need not be copied; a vertex is *representative* if it maps to itself.
    pub representative: Vec<u32>,
    /// Distinct positions, which is the number of representatives.
    pub unique: usize,
}

/// Welds `positions` by exact equality. Sorts their hashes, in parallel: a table of them would miss the cache once a vertex.
///
/// NaN coordinates are welded if their bits are equal. An empty slice gives an empty weld. Positions beyond
/// the first `u32::MAX` are out of reach of 32-bit indices and are not read.
pub fn weld(positions: &[Vec3]) -> Weld {
    let positions = &positions[..positions.len().min(u32::MAX as usize)];
    // Hash above vertex: one integer, which sorts as the pair does.
    let entry = |(vertex, &position): (usize, &Vec3)| hash(key(position)) >> 32 << 32 | vertex as u64;
    let mut by_hash: Vec<u64> = positions.par_iter().enumerate().map(entry).collect();
    by_hash.par_sort_unstable();
    let mut representative = vec![0; positions.len()];
    let mut unique = 0;
    let mut firsts = Vec::new();
    for same_hash in by_hash.chunk_by(|a, b| a >> 32 == b >> 32) {
        firsts.clear();
        for vertex in same_hash.iter().map(|&entry| entry as u32) {
            let position = || key(positions[vertex as usize]);
            // Almost always there is one; alone in its run, it is not even read.
            let first =
                firsts.iter().copied().find(|&first: &u32| key(positions[first as usize]) == position());
            let first = first.unwrap_or_else(|| {
                firsts.push(vertex);
                vertex
            });
            representative[vertex as usize] = first;
        }
        unique += firsts.len();
    }
    Weld { representative, unique }
}

/// The bits of a position, with −0 turned into +0 (IEEE 754: −0 + 0 = +0).
#[inline]
fn key(position: Vec3) -> [u32; 3] {
    [position.x + 0.0, position.y + 0.0, position.z + 0.0].map(f32::to_bits)
}

/// Mixes by a folded 128-bit product: coordinates of meshes differ in few bits (grids, integers), and both
/// halves of the product together depend on all of them.
#[inline]
fn hash([x, y, z]: [u32; 3]) -> u64 {
    let a = (u64::from(x) | u64::from(y) << 32) ^ 0x9E37_79B9_7F4A_7C15;
    let b = u64::from(z).wrapping_mul(0xD6E8_FEB8_6659_FD93) ^ 0xA076_1D64_78BD_642F;
    let product = u128::from(a) * u128::from(b);
    let folded = (product as u64) ^ (product >> 64) as u64;
    folded ^ folded >> 32
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn equal_positions_meet_at_the_first_and_zeros_are_equal() {
        let p =
            [Vec3::ONE, Vec3::ZERO, Vec3::splat(-0.0), Vec3::ONE, Vec3::new(1.0, 1.0, 1.0 + f32::EPSILON)];
        assert_eq!(weld(&p), Weld { representative: vec![0, 1, 1, 0, 4], unique: 3 });
    }

    #[test]
    fn nothing_welds_to_nothing() {
        assert_eq!(weld(&[]), Weld { representative: vec![], unique: 0 });
    }

    #[test]
    fn grids_do_not_share_hashes() {
        // A power-of-two grid differs in few bits of each coordinate: a weak hash would take minutes here.
        let side = 64;
        let grid: Vec<Vec3> = (0..side * side * side)
            .map(|i| Vec3::new((i % side) as f32, (i / side % side) as f32, (i / side / side) as f32))
            .collect();
        assert_eq!(weld(&grid).unique, grid.len());
    }

    proptest! {
        #[test]
        fn representatives_are_the_first_of_their_position(
            raw in prop::collection::vec((-2i8..3, -2i8..3, -2i8..3), 0..200)
        ) {
            let positions: Vec<Vec3> =
                raw.iter().map(|&(x, y, z)| Vec3::new(f32::from(x), f32::from(y), f32::from(z))).collect();
            let weld = weld(&positions);
            for (vertex, &p) in positions.iter().enumerate() {
                let first = positions.iter().position(|&q| q == p).unwrap();
                prop_assert_eq!(weld.representative[vertex] as usize, first);
            }
            let kept = (0..positions.len()).filter(|&v| weld.representative[v] as usize == v).count();
            prop_assert_eq!(weld.unique, kept);
        }
    }
}
