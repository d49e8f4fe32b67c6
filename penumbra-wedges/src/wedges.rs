//! What is prepared for one light: edges and the wedges around them.

use glam::Vec3;
use rayon::prelude::*;
use scene_core::bvh::Bvh;
use scene_core::geometry::facing_of;
use scene_core::{Camera, Light, Report};

use crate::area_light::{AreaLight, LightShape};
use crate::casters::Casters;
use crate::edges::{CandidateEdge, Edges, FaceSide, may_touch, side_of};
use crate::interpolated::{Side, wedge_of};
use crate::params::{Variant, WedgeParams};
use crate::samples::{PATTERNS, Samples};
use crate::shaft::EdgeGroups;
use crate::wedge::Wedge;

/// The wedges of all edges that matter.
#[derive(Debug)]
pub struct Wedges {
    /// The light.
    pub light: AreaLight,
    /// The edges, and what is left and right of them.
    pub edges: Edges,
    /// The wedge of each edge.
    pub wedges: Vec<Wedge>,
    /// Boxes around runs of edges; `None` for `interpolated`, whose wedges are not bounded by the ways to the light.
    pub groups: Option<EdgeGroups>,
    /// Samples of the light, one pattern for each pixel of a tile.
    pub patterns: Vec<Samples>,
    /// Faces whose shadow has no edges to be counted: those that touch the light, or have a mask.
    pub traced: Option<Bvh>,
    /// How many faces these are.
    pub traced_count: usize,
    /// What a variant that counts from the light's middle needs besides.
    pub middle: Option<FromMiddle>,
}

/// For variants that take the silhouette that the light's middle sees.
#[derive(Debug, Default)]
pub struct FromMiddle {
    /// The facing of each face that counts as a layer ([`bodies`](crate::bodies)), else 0.
    pub facing: Vec<i8>,
    /// The side planes of each edge; for `interpolated`.
    pub sides: Vec<[Side; 2]>,
}

impl Wedges {
    /// The wedges of `light` for `camera`.
    pub fn new(
        casters: &Casters<'_>,
        light: &Light,
        area: AreaLight,
        camera: &Camera,
        params: &WedgeParams,
        report: &mut Report,
    ) -> Self {
        let scene = casters.scene;
        // The wedges of `interpolated` reach beyond the ways to the light, and have their side planes from neighbours.
        let skip = params.skip && params.variant != Variant::Interpolated;
        let relevant =
            report.time("prepare.relevance", |report| casters.relevant(light, camera, skip, report));
        let (face_sides, traced) = report.time("prepare.facing", |_| {
            let mut sides = casters.for_faces(FaceSide::None, |face| side_of(&area, scene.corners(face)));
            let near =
                |face: &usize| sides[*face] == FaceSide::Variable && may_touch(&area, scene.corners(*face));
            let touching: Vec<usize> = (0..sides.len()).into_par_iter().filter(near).collect();
            touching.iter().for_each(|&face| sides[face] = FaceSide::None);
            let masked = scene.objects().iter().filter(|o| o.flags.casts && o.alpha.is_some());
            let traced: Vec<usize> =
                touching.into_iter().chain(masked.flat_map(|o| o.triangles.clone())).collect();
            (sides, traced)
        });
        let from_middle = params.variant != Variant::Exact;
        if from_middle {
            report.time("prepare.bodies", |_| casters.bodies());
        }
        let (edges, facing) = report.time("prepare.silhouette", |_| {
            if from_middle {
                let facing = layers(casters, &area, &face_sides);
                (Edges::from_one_point(casters, &facing, &relevant), facing)
            } else {
                (Edges::from_some_point(casters, &face_sides, &relevant), Vec::new())
            }
        });
        let sides = if params.variant == Variant::Interpolated {
            report.time("prepare.sides", |_| Side::of_edges(&area, &edges.candidates))
        } else {
            Vec::new()
        };
        let wedges = report.time("prepare.wedges", |_| {
            let edges = edges.candidates.par_iter().with_min_len(256).enumerate();
            let wedge = |(index, edge): (usize, &CandidateEdge)| match sides.get(index) {
                Some(sides) => wedge_of(&area, edge, sides),
                None => Wedge::new(&area, edge.a.as_dvec3(), edge.b.as_dvec3()),
            };
            edges.map(wedge).collect()
        });
        let groups = (params.variant != Variant::Interpolated)
            .then(|| report.time("prepare.groups", |_| EdgeGroups::new(&edges.candidates)));
        let middle = from_middle.then_some(FromMiddle { facing, sides });
        let patterns = report.time("prepare.samples", |_| {
            let is_round = !matches!(area.shape, LightShape::Rect { .. });
            let pattern = |index| Samples::new(is_round, params.views, params.seed, index);
            (0..PATTERNS).into_par_iter().map(pattern).collect()
        });
        let traced_count = traced.len();
        let traced =
            report.time("prepare.traced", |_| (!traced.is_empty()).then(|| Bvh::of_triangles(scene, traced)));
        Self { light: area, edges, wedges, groups, patterns, traced, traced_count, middle }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let samples: usize =
            self.patterns.iter().map(|p| 2 * size_of_val(&p.u[..]) + size_of_val(&p.span[..])).sum();
        let middle = self.middle.as_ref();
        self.edges.bytes()
            + size_of_val(&self.wedges[..])
            + self.groups.as_ref().map_or(0, EdgeGroups::bytes)
            + samples
            + self.traced.as_ref().map_or(0, Bvh::bytes)
            + middle.map_or(0, |m| size_of_val(&m.facing[..]) + size_of_val(&m.sides[..]))
    }
}

/// The facing of faces that count as layers, from the light's middle.
fn layers(casters: &Casters<'_>, light: &AreaLight, sides: &[FaceSide]) -> Vec<i8> {
    let kinds = &casters.bodies().kinds;
    let center = light.center();
    casters.for_faces(0, |face| {
        let corners: [Vec3; 3] = casters.scene.corners(face);
        match (sides[face], facing_of(corners, center)) {
            (FaceSide::None, _) => 0,
            (_, facing) => kinds[face].counts(facing),
        }
    })
}
