//! Outlines of cut-out casters: edges that no mesh has.
//!
//! A mask's outline has as many corners as its texels, on every triangle that it is drawn on; the map sees no more of it
//! than its own texels. So the outline is taken from the map, layer by layer: between two texels' centres of which a
//! masked triangle covers one, its border crosses, and the mask itself says where (bisection along the segment between the
//! centres). In each square of four centres the crossings are joined, solid on the left as the light sees it (marching
//! squares). The result is closed by construction and agrees with the count of layers at every texel's centre; two
//! triangles that share an edge have the same crossings there, in opposite directions, and cancel.
//!
//! An outline is exact at its crossings and straight between them: what is smaller than a texel is lost, as in the map.

use glam::{DVec3, Vec2, Vec3, Vec4};
use rayon::prelude::*;
use scene_core::Scene;
use scene_core::geometry::{AlphaMask, facing_of};
use scene_core::light::LightPoint;

use crate::cells::outlines;
use crate::layers::Layers;
use crate::silhouettes::{Edge, plane};

/// Halvings of the segment between two centres: 2⁻⁸ texel, the rasteriser's own step.
const HALVINGS: usize = 8;

/// The outlines of all masked triangles in a view's map, relative to `origin`.
pub fn mask_edges(scene: &Scene, origin: Vec3, layers: &Layers, center: LightPoint) -> Vec<Edge> {
    if !scene.has_alpha() {
        return Vec::new();
    }
    let size = layers.image.size as i32;
    let rows = (-1..size).into_par_iter().map(|row| {
        let (mut edges, mut known, mut triangles) = (Vec::new(), None, Vec::new());
        for column in -1..size {
            let corners = [[column, row], [column + 1, row], [column + 1, row + 1], [column, row + 1]];
            let covers = corners.map(|[x, y]| layers.fragments.of(x as u32, y as u32));
            triangles.clear();
            triangles.extend(covers.iter().flat_map(|of| of.iter().map(|fragment| fragment.triangle)));
            triangles.sort_unstable();
            triangles.dedup();
            for &triangle in &triangles {
                let solid = covers.map(|of| of.iter().any(|fragment| fragment.triangle == triangle));
                if solid == [true; 4] {
                    continue;
                }
                // Neighbours mostly ask of the same triangle.
                if !matches!(&known, Some((id, _)) if *id == triangle) {
                    known = Some((triangle, Face::new(scene, layers, triangle as usize)));
                }
                let Some((_, Some(face))) = &known else { continue };
                for [from, to] in outlines(solid, |side| face.crossing(corners, side, solid)) {
                    let ends = [from, to].map(|at| face.point(at));
                    if let [Some(a), Some(b)] = ends {
                        edges.push(face.edge(scene, a - origin, b - origin, origin, center));
                    }
                }
            }
        }
        edges
    });
    rows.collect::<Vec<_>>().concat()
}

/// A masked triangle as the map sees it: weights of its corners are linear in homogeneous texels.
struct Face<'a> {
    triangle: usize,
    mask: &'a AlphaMask,
    weights: [DVec3; 3],
    corners: [Vec3; 3],
    uvs: [Vec2; 3],
    /// Texels a side of the map.
    size: f32,
}

impl<'a> Face<'a> {
    /// `None` for a triangle without a mask.
    fn new(scene: &'a Scene, layers: &Layers, triangle: usize) -> Option<Self> {
        let mask = scene.objects().get(scene.object_of(triangle) as usize)?.alpha.as_deref()?;
        let matrix = layers.image.view.projection_from_world.as_dmat4();
        let half = f64::from(layers.image.size) * 0.5;
        let corners = scene.corners(triangle);
        let [a, b, c] = corners.map(|corner| {
            let clip = matrix * corner.as_dvec3().extend(1.0);
            DVec3::new((clip.x + clip.w) * half, (clip.w - clip.y) * half, clip.w)
        });
        let uvs = scene.triangles()[triangle]
            .map(|vertex| scene.uvs().get(vertex as usize).copied().unwrap_or(Vec2::NAN));
        let (weights, size) = ([b.cross(c), c.cross(a), a.cross(b)], layers.image.size as f32);
        Some(Self { triangle, mask, weights, corners, uvs, size })
    }

    /// Weights of the corners at a place of the image, of sum 1; `None` where the plane has no such place.
    fn weights(&self, at: Vec2) -> Option<[f32; 3]> {
        let place = at.as_dvec2().extend(1.0);
        let weights = self.weights.map(|weight| weight.dot(place));
        let sum: f64 = weights.iter().sum();
        let weights = weights.map(|weight| (weight / sum) as f32);
        weights.iter().all(|weight| weight.is_finite()).then_some(weights)
    }

    fn is_solid(&self, at: Vec2) -> bool {
        self.weights(at).is_some_and(|[a, b, c]| {
            let inside = a >= 0.0 && b >= 0.0 && c >= 0.0;
            inside && self.mask.is_solid(self.uvs[0] * a + self.uvs[1] * b + self.uvs[2] * c)
        })
    }

    /// Where the border crosses a side of a square of centres.
    fn crossing(&self, corners: [[i32; 2]; 4], side: usize, solid: [bool; 4]) -> Vec2 {
        let center = |corner: usize| Vec2::from(corners[corner].map(|at| at as f32 + 0.5));
        // Always in the same direction, so that the squares on both sides find the same place.
        let (i, j) = (side, (side + 1) % 4);
        let (i, j) = if corners[i] < corners[j] { (i, j) } else { (j, i) };
        let (from, to) = (center(i), center(j));
        // Beyond the border of a cube's face another map goes on: the two outlines cancel on the border itself.
        let is_inside = |at: Vec2| at.min_element() >= 0.0 && at.max_element() <= self.size;
        let middle = from.midpoint(to);
        if is_inside(from) != is_inside(to) && self.is_solid(middle) {
            return middle;
        }
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if self.is_solid(from.lerp(to, middle)) == solid[i] {
                low = middle;
            } else {
                high = middle;
            }
        }
        // Strictly between the centres, whose coverage the rasteriser decided, by its own step.
        from.lerp(to, (0.5 * (low + high)).clamp(1.0 / 128.0, 127.0 / 128.0))
    }

    fn point(&self, at: Vec2) -> Option<Vec3> {
        let [a, b, c] = self.weights(at)?;
        Some(self.corners[0] * a + self.corners[1] * b + self.corners[2] * c)
    }

    /// An outline's segment, solid on its left as the light's centre sees it: there sign(e, f)·side(f) is +1.
    fn edge(&self, scene: &Scene, a: Vec3, b: Vec3, origin: Vec3, center: LightPoint) -> Edge {
        let corners = scene.corners(self.triangle);
        let facing = facing_of(corners, center);
        Edge {
            a,
            b,
            planes: [plane(corners, origin), Vec4::ZERO],
            signs: [f32::from(facing), 0.0],
            from_center: i8::from(facing != 0),
            far: Vec3::NAN,
        }
    }
}
