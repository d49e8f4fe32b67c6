//! Repairs of a triangle soup that change no picture: faces without area and exact duplicates are removed.
//!
//! Faces are compared by the *positions* of their corners, so that a mesh with a vertex a face is treated
//! like an indexed one. Nothing is merged, moved or reoriented. Two faces back to back are no duplicates:
//! they make a closed sheet, and edge topology counts both.

use glam::Vec3;

use super::TriangleMesh;
use crate::splitmix;

/// How many faces were removed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Repairs {
    /// Faces whose area is zero.
    pub degenerate: usize,
    /// Faces that repeat an earlier one: same corners, same winding and, if there is a mask, same texture
    /// coordinates.
    pub duplicate: usize,
}

impl Repairs {
    /// Adds another mesh's counts.
    pub fn add(&mut self, other: Self) {
        self.degenerate += other.degenerate;
        self.duplicate += other.duplicate;
    }

    /// A sentence for the user, or `None` if nothing was removed.
    pub fn note(&self) -> Option<String> {
        let faces = |count: usize, what: &str| {
            let noun = if count == 1 { "triangle" } else { "triangles" };
            (count > 0).then(|| format!("{count} {noun} {what}"))
        };
        let parts: Vec<_> =
            [faces(self.degenerate, "without area"), faces(self.duplicate, "that repeat another exactly")]
                .into_iter()
                .flatten()
                .collect();
        (!parts.is_empty()).then(|| format!("removed {}", parts.join(" and ")))
    }
}

/// Removes faces without area and exact duplicates from `mesh`, which must pass
/// [`validate`](TriangleMesh::validate); the first of several equal faces stays, and the order of the rest.
/// Vertices that no face uses any more are dropped.
///
/// Takes O(n) time, and O(k log k) for k copies. An empty mesh is left alone; NaN
/// positions are never equal and never degenerate.
///
/// # Panics
/// If an index is out of range.
pub fn remove_faulty_faces(mesh: &mut TriangleMesh) -> Repairs {
    let before = mesh.triangles.len();
    let positions = &mesh.positions;
    mesh.triangles.retain(|t| !is_degenerate(t.map(|i| positions[i as usize])));
    let repairs = Repairs { degenerate: before - mesh.triangles.len(), duplicate: remove_duplicates(mesh) };
    if repairs != Repairs::default() {
        drop_unused_vertices(mesh);
    }
    repairs
}

/// Whether a triangle's area is zero: two corners coincide, or all lie on a line.
///
/// Differences of f32 are taken in f64, where they and their products (2 × 25 bits) are exact unless the
/// exponents of the coordinates are more than 2²⁸ apart. So a triangle is dropped only if it is truly flat,
/// or so thin that f64 cannot tell.
fn is_degenerate([a, b, c]: [Vec3; 3]) -> bool {
    let (ab, ac) = (b.as_dvec3() - a.as_dvec3(), c.as_dvec3() - a.as_dvec3());
    ab.cross(ac) == glam::DVec3::ZERO
}

/// Removes later copies of a face and returns how many.
///
/// Faces with equal corners have equal hashes. Two bit sets, of which a slot is "seen" and "seen again", leave
/// one face in sixteen and the true copies to be sorted.
fn remove_duplicates(mesh: &mut TriangleMesh) -> usize {
    let vertex_hashes: Vec<u64> = mesh.positions.iter().map(|p| hash_position(*p)).collect();
    // A sum does not depend on which corner comes first.
    let hash = |t: &[u32; 3]| {
        splitmix::hash(t.iter().fold(0u64, |sum, &i| sum.wrapping_add(vertex_hashes[i as usize])))
    };
    let slots = (mesh.triangles.len() * 16).next_power_of_two().max(64);
    let slot = |hash: u64| ((hash as usize & (slots - 1)) / 64, 1u64 << (hash & 63));
    let (mut seen, mut again) = (vec![0u64; slots / 64], vec![0u64; slots / 64]);
    let hashes: Vec<u64> = mesh.triangles.iter().map(hash).collect();
    for &hash in &hashes {
        let (word, bit) = slot(hash);
        again[word] |= seen[word] & bit;
        seen[word] |= bit;
    }
    let is_candidate = |hash: u64| {
        let (word, bit) = slot(hash);
        again[word] & bit != 0
    };
    // The index makes keys unique; the high half of the hash brings candidates together.
    let mut keys: Vec<u64> = (0u64..)
        .zip(&hashes)
        .filter(|&(_, &hash)| is_candidate(hash))
        .map(|(index, hash)| hash & !0xffff_ffff | index)
        .collect();
    keys.sort_unstable();

    let mut repeated = Vec::new();
    for run in keys.chunk_by(|a, b| a >> 32 == b >> 32).filter(|run| run.len() > 1) {
        let mut faces: Vec<_> = run
            .iter()
            .map(|&key| (canonical_face(mesh, (key & 0xffff_ffff) as usize), (key & 0xffff_ffff) as usize))
            .collect();
        faces.sort_unstable();
        repeated.extend(faces.windows(2).filter(|pair| pair[0].0 == pair[1].0).map(|pair| pair[1].1));
    }
    if !repeated.is_empty() {
        repeated.sort_unstable();
        let mut next = repeated.iter().peekable();
        let mut index = 0;
        mesh.triangles.retain(|_| {
            let remove = next.next_if(|&&r| r == index).is_some();
            index += 1;
            !remove
        });
    }
    repeated.len()
}

/// Bits of a face's corners, texture coordinates included where they matter, turned so that the smallest
/// corner comes first: equal for equal faces, whichever corner they start at.
fn canonical_face(mesh: &TriangleMesh, triangle: usize) -> [[u32; 5]; 3] {
    let masked = mesh.alpha.is_some();
    let mut corners = mesh.triangles[triangle].map(|i| {
        let [x, y, z] = position_bits(mesh.positions[i as usize]);
        let [u, v] = if masked { mesh.uvs[i as usize].to_array().map(bits) } else { [0; 2] };
        [x, y, z, u, v]
    });
    let first = (0..3).min_by_key(|&i| corners[i]).unwrap_or(0);
    corners.rotate_left(first);
    corners
}

/// Drops vertices that no face refers to, and keeps the order of the others.
///
/// # Panics
/// If an index is out of range.
pub fn drop_unused_vertices(mesh: &mut TriangleMesh) {
    const UNUSED: u32 = u32::MAX;
    let mut new_index = vec![UNUSED; mesh.positions.len()];
    for &i in mesh.triangles.iter().flatten() {
        new_index[i as usize] = 0;
    }
    let mut used = 0;
    for index in new_index.iter_mut().filter(|index| **index != UNUSED) {
        *index = used;
        used += 1;
    }
    if used as usize == mesh.positions.len() {
        return;
    }
    let mut keep = new_index.iter().map(|&index| index != UNUSED);
    mesh.positions.retain(|_| keep.next() == Some(true));
    let mut keep = new_index.iter().map(|&index| index != UNUSED);
    mesh.uvs.retain(|_| keep.next() == Some(true));
    for corner in mesh.triangles.iter_mut().flatten() {
        *corner = new_index[*corner as usize];
    }
}

/// The bits of a coordinate, alike for 0 and −0.
fn bits(coordinate: f32) -> u32 {
    (coordinate + 0.0).to_bits()
}

fn position_bits(position: Vec3) -> [u32; 3] {
    position.to_array().map(bits)
}

fn hash_position(position: Vec3) -> u64 {
    let [x, y, z] = position_bits(position).map(u64::from);
    splitmix::hash(splitmix::hash(x | y << 32).wrapping_add(z))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::Vec2;

    use super::super::AlphaMask;
    use super::*;

    fn mesh(triangles: Vec<[u32; 3]>) -> TriangleMesh {
        let positions =
            vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(2.0, 0.0, 0.0), Vec3::new(-0.0, 0.0, -0.0), Vec3::X];
        TriangleMesh::new("m", positions, triangles)
    }

    #[test]
    fn degenerate_faces_go() {
        // Twice the same index, twice the same position, three on a line.
        let mut m = mesh(vec![[0, 0, 1], [0, 4, 2], [0, 1, 3], [0, 1, 2]]);
        let repairs = remove_faulty_faces(&mut m);
        assert_eq!(repairs, Repairs { degenerate: 3, duplicate: 0 });
        assert_eq!((m.triangles.as_slice(), m.positions.len()), (&[[0, 1, 2]][..], 3));
    }

    #[test]
    fn thin_is_not_degenerate() {
        let far = Vec3::splat(1e6);
        let next = Vec3::new(1e6, 1e6, 1e6_f32.next_up());
        let mut m = TriangleMesh::new("", vec![far, next, far + Vec3::X], vec![[0, 1, 2]]);
        assert_eq!(remove_faulty_faces(&mut m), Repairs::default());
    }

    #[test]
    fn duplicates_are_found_by_position_and_winding() {
        // The second is turned, the third uses other vertices, the fourth is back to back.
        let mut m = mesh(vec![[0, 1, 2], [1, 2, 0], [4, 5, 2], [0, 2, 1]]);
        assert_eq!(remove_faulty_faces(&mut m), Repairs { degenerate: 0, duplicate: 2 });
        assert_eq!(m.triangles, [[0, 1, 2], [0, 2, 1]]);
    }

    #[test]
    fn masked_faces_differ_by_texture_coordinates() {
        let mut m = mesh(vec![[0, 1, 2], [4, 5, 2]]);
        m.uvs = vec![Vec2::ZERO; 6];
        m.uvs[5] = Vec2::X;
        m.alpha = AlphaMask::from_alpha(1, 1, &[0], 0.5, Default::default()).map(Arc::new);
        assert_eq!(remove_faulty_faces(&mut m.clone()), Repairs::default());
        m.alpha = None;
        assert_eq!(remove_faulty_faces(&mut m).duplicate, 1);
        assert_eq!(m.uvs.len(), m.positions.len());
    }

    #[test]
    fn many_copies_of_one_face_take_no_quadratic_time() {
        let mut m = mesh(vec![[0, 1, 2]; 300_000]);
        assert_eq!(remove_faulty_faces(&mut m).duplicate, 299_999);
        assert_eq!(m.triangles.len(), 1);
    }
}
