//! What the shaders read: the uniform, and tables of edges and lists. A test holds every offset against the linked WGSL.

use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec3, Vec4};
use scene_core::gpu::binding;
use scene_core::light::{LightHull, LightPoint};

use crate::PreparedDdoc;
use crate::grid::TileLists;
use crate::layers::Layers;
use crate::params::Variant;
use crate::silhouettes::Edge;

/// Views of a light at most: the faces of a cube.
pub const MOST_VIEWS: usize = 6;

/// `ABSENT` of `edges.wesl`.
const ABSENT: u32 = u32::MAX;

/// `ViewTable` of `edges.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct ViewTable {
    /// Texels a side of the map.
    pub size: u32,
    /// Where the lists of faces are told.
    pub faces: u32,
    /// Grids of them.
    pub face_levels: u32,
    /// Where the lists of splats are told.
    pub splats: u32,
    /// Grids of them.
    pub splat_levels: u32,
    /// Tiles a side of the finest grid.
    pub tiles: u32,
    /// Texels a side of such a tile.
    pub tile: u32,
    /// Texels beside the map.
    pub margin: u32,
    /// Where the triangles over texels' centres are told.
    pub fragments: u32,
    /// Where the outlines are told.
    pub outlines: u32,
    /// Zero.
    pub padding: [u32; 2],
}

/// `Ddoc` of `edges.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct DdocUniform {
    /// What edges are relative to.
    pub origin: Vec3,
    /// Points of the light.
    pub taps: u32,
    /// [`plane_tolerance`](gnomon_shadow_map::receiver_plane::plane_tolerance).
    pub tolerance: f32,
    /// Views.
    pub count: u32,
    /// 0: coverage; 1: the nearest splat; 2: the darkest.
    pub kind: u32,
    /// 1 where the nearest fragment alone counts.
    pub single: u32,
    /// The first edge that is an outline of the map.
    pub first_outline: u32,
    /// Where the vectors of outlines begin.
    pub outlines: u32,
    /// Receivers that a workgroup of `shade.rest` answers.
    pub alone: u32,
    /// Zero.
    pub padding: u32,
    /// Views and their tables.
    pub views: [ViewTable; MOST_VIEWS],
    /// Corners of the light's hull: places, or directions with w = 0; w = −1 where there are no more.
    pub hull: [Vec4; 8],
    /// a of the points.
    pub xs: [f32; 1024],
    /// b of the points.
    pub ys: [f32; 1024],
}

/// All that is uploaded beside the views.
#[derive(Debug)]
pub struct Tables {
    /// The uniform.
    pub uniform: DdocUniform,
    /// Lists and where they begin.
    pub words: Vec<u32>,
    /// Four vectors an edge, then two an outline.
    pub edges: Vec<[f32; 4]>,
}

impl Tables {
    /// How group 0 binds the uniform, views, words and edges, the last two in buffers or in pages.
    pub const fn bindings(are_paged: bool) -> [wgpu::BindingType; 4] {
        let [words, edges] = match are_paged {
            false => [binding::STORAGE; 2],
            true => [binding::ID_LAYERS, binding::FLOAT_LAYERS],
        };
        [binding::UNIFORM, binding::STORAGE, words, edges]
    }

    /// Of what the CPU has prepared; `splats` are those of each view.
    pub fn new(prepared: &PreparedDdoc<'_>, splats: &[TileLists]) -> Self {
        let mut uniform = DdocUniform {
            origin: prepared.origin,
            tolerance: prepared.base.tolerance,
            count: prepared.layers.len() as u32,
            kind: match prepared.variant {
                Variant::Smoothies => 1,
                Variant::PenumbraMap => 2,
                Variant::Ddoc | Variant::ImageEdges | Variant::Paper => 0,
            },
            first_outline: prepared.first_outline as u32,
            outlines: 4 * prepared.edges.len() as u32,
            hull: [Vec4::NEG_W; 8],
            ..Zeroable::zeroed()
        };
        for (into, corner) in uniform.hull.iter_mut().zip(prepared.hull.iter().flat_map(LightHull::corners)) {
            *into = match *corner {
                LightPoint::At(place) => (place - prepared.origin).extend(1.0),
                LightPoint::Towards(way) => way.extend(0.0),
            };
        }
        uniform.taps = prepared.points.len().min(uniform.xs.len()) as u32;
        for (index, &Vec2 { x, y }) in prepared.points.iter().enumerate().take(uniform.taps as usize) {
            (uniform.xs[index], uniform.ys[index]) = (x, y);
        }
        let (mut words, mut edges) = (Vec::new(), edge_vectors(&prepared.edges, prepared.first_outline));
        let views = prepared.layers.iter().zip(&prepared.faces).zip(splats);
        for (into, ((layers, faces), splats)) in uniform.views.iter_mut().zip(views) {
            let (faces, grid) = (faces.lists(), splats.grid());
            *into = ViewTable {
                size: layers.image.size,
                faces: append(&mut words, faces.first(), faces.all().iter().copied()),
                face_levels: faces.grid().levels(),
                splats: append(&mut words, splats.first(), splats.all().iter().copied()),
                splat_levels: grid.levels(),
                tiles: grid.tiles(),
                tile: grid.texels(),
                margin: grid.margin(),
                fragments: ABSENT,
                outlines: ABSENT,
                padding: [0; 2],
            };
            uniform.single = u32::from(layers.single);
            if !layers.fragments.is_empty() {
                (into.fragments, into.outlines) = append_layers(&mut words, layers);
                for outline in layers.outlines() {
                    let [[ax, ay], [bx, by]] = outline.ends;
                    let place =
                        4 * prepared.edges.len() + 2 * (outline.edge as usize - prepared.first_outline);
                    edges[place + 1] = [ax, ay, bx, by].map(|at| at as f32);
                }
            }
        }
        Self { uniform, words, edges }
    }
}

/// Appends lists: where each begins among all words, one more for the end of the last, and what they hold. Gives the place
/// of the first.
fn append(words: &mut Vec<u32>, first: &[u32], all: impl Iterator<Item = u32>) -> u32 {
    let begin = words.len() as u32;
    let lists = begin + first.len() as u32;
    words.extend(first.iter().map(|at| lists + at));
    words.extend(all);
    begin
}

fn append_layers(words: &mut Vec<u32>, layers: &Layers) -> (u32, u32) {
    let fragments = &layers.fragments;
    let triangles = fragments.all().iter().map(|fragment| fragment.triangle);
    let fragments = append(words, fragments.first(), triangles);
    // An outline's list names edges, so that nothing stands between.
    let squares = layers.squares();
    let edges = squares.all().iter().map(|&outline| layers.outlines()[outline as usize].edge);
    (fragments, append(words, squares.first(), edges))
}

/// Edges as `edge_at` of `edges.wesl` reads them: an end and a sign, twice, and two planes. Then those from `first_outline` on
/// as `outline_at` does: what is seen past the edge beside m(e) as the centre sees it, plus 8 if anything is, and both ends in
/// the image, which are not known here.
fn edge_vectors(edges: &[Edge], first_outline: usize) -> Vec<[f32; 4]> {
    let of_edge = |edge: &Edge| {
        [
            edge.a.extend(edge.signs[0]).to_array(),
            edge.b.extend(edge.signs[1]).to_array(),
            edge.planes[0].to_array(),
            edge.planes[1].to_array(),
        ]
    };
    let of_outline = |edge: &Edge| {
        let has_far = !edge.far.is_nan();
        let far = if has_far { edge.far } else { Vec3::ZERO };
        let told = f32::from(edge.from_center) + if has_far { 8.0 } else { 0.0 };
        [far.extend(told).to_array(), [0.0; 4]]
    };
    let outlines = edges.iter().skip(first_outline).flat_map(of_outline);
    edges.iter().flat_map(of_edge).chain(outlines).collect()
}

#[cfg(test)]
mod tests {
    use scene_core::assert_layout;
    use scene_core::gpu::testing::assert_constants;
    use scene_core::raster::DEPTH_POSITION_ERROR;

    use super::*;
    use crate::gpu::shaders::{GROUPS, REST, SHADE};
    use crate::gpu::{LOOKED_AT_ONCE, MOST_TURNS, groups};
    use crate::{beam, grid};

    #[test]
    fn layouts_are_those_of_the_shaders() {
        assert_layout!(
            ViewTable,
            SHADE,
            "ViewTable",
            [
                size,
                faces,
                face_levels,
                splats,
                splat_levels,
                tiles,
                tile,
                margin,
                fragments,
                outlines,
                padding
            ]
        );
        assert_layout!(
            DdocUniform,
            SHADE,
            "Ddoc",
            [
                origin,
                taps,
                tolerance,
                count,
                kind,
                single,
                first_outline,
                outlines,
                alone,
                padding,
                views,
                hull,
                xs,
                ys
            ]
        );
    }

    #[test]
    fn constants_are_those_of_the_shaders() {
        assert_constants(
            GROUPS,
            &[
                ("TILE", f64::from(groups::TILE)),
                ("MOST_TURNS", f64::from(MOST_TURNS)),
                ("beam_TILT", f64::from(beam::TILT)),
                ("beam_SHIFT", f64::from(beam::SHIFT)),
                ("edges_RATIO", f64::from(grid::RATIO)),
            ],
        );
        assert_constants(REST, &[("TILE", f64::from(groups::TILE)), ("THREADS", f64::from(groups::THREADS))]);
        assert_constants(
            SHADE,
            &[
                ("LOOKED_AT_ONCE", f64::from(LOOKED_AT_ONCE)),
                ("before_center_DEPTH_POSITION_ERROR", f64::from(DEPTH_POSITION_ERROR)),
            ],
        );
    }

    #[test]
    fn lists_begin_where_they_are_said_to() {
        let mut words = vec![7, 7];
        let begin = append(&mut words, &[0, 2, 2, 3], [10, 11, 12].into_iter()) as usize;
        let list = |i: usize| &words[words[begin + i] as usize..words[begin + i + 1] as usize];
        assert_eq!((list(0), list(1), list(2)), (&[10, 11][..], &[][..], &[12][..]));
    }
}
