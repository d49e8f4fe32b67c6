#![doc = include_str!("../README.md")]

pub mod beam;
mod block_faces;
mod blocks;
pub mod cells;
mod chosen;
pub mod coverage;
pub mod cpu;
pub mod discontinuity;
pub mod distortion_map;
pub mod faces;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod grid;
pub mod image_edges;
mod lanes;
pub mod layers;
mod light_cones;
pub mod light_image;
mod light_points;
pub mod mask_edges;
pub mod outer;
pub mod paper;
mod params;
pub mod silhouettes;
mod sites;
pub mod splat;
mod technique;
pub mod tile_edges;
pub mod tiles;
mod vectors;

use std::collections::HashSet;

use glam::{Vec2, Vec3};
use gnomon_shadow_map::cpu::receiver;
use gnomon_shadow_map::light_maps::{LightMaps, Receiver};
use gnomon_shadow_map::light_views::light_views;
use gnomon_shadow_map::receiver_plane::plane_tolerance;
use scene_core::geometry::{Aabb, Object, TopologyError};
use scene_core::light::{LightHull, LightPoint};
use scene_core::{GBuffer, Light, Origin, Report, Scene, VisibilityImage, relevance};

use discontinuity::Discontinuities;
use faces::Faces;
use grid::Grid;
use layers::Layers;
use light_image::LightImage;
pub use params::{DdocParams, Variant};
use silhouettes::{Edge, silhouettes};
pub use technique::Factory;

/// The technique: settings, from which any number of lights can be prepared.
#[derive(Clone, Copy, Debug, Default)]
pub struct Ddoc {
    params: DdocParams,
}

/// One light's map and edges, borrowing the scene it shines on. Holds for any camera.
#[derive(Debug)]
pub struct PreparedDdoc<'a> {
    /// The scene, the light, what their coordinates are counted from, and the tolerance; no maps.
    base: LightMaps<'a>,
    /// The map, a view each: solid faces, and all that has its edges from the map.
    faces: Vec<Faces>,
    layers: Vec<Layers>,
    /// Where edges are counted from, in the coordinates of `base`.
    origin: Vec3,
    edges: Vec<Edge>,
    /// Those from here on are outlines of the map.
    #[cfg_attr(not(feature = "gpu"), expect(dead_code, reason = "the GPU's tables alone tell them apart"))]
    first_outline: usize,
    /// Bounds of the light; none of a sun that is too wide.
    hull: Option<LightHull>,
    /// Those of its centre.
    center_hull: Option<LightHull>,
    /// Points of the light as shares of it.
    points: Vec<Vec2>,
    variant: Variant,
    skip: bool,
}

impl Ddoc {
    /// A technique with these settings.
    pub fn new(params: DdocParams) -> Self {
        Self { params }
    }

    /// Draws the map of `light` and finds the edges that bound its penumbrae.
    ///
    /// # Errors
    /// More triangles than edges can be counted of.
    pub fn prepare<'a>(
        &self,
        scene: &'a Scene,
        light: &Light,
    ) -> Result<(PreparedDdoc<'a>, Report), TopologyError> {
        self.prepare_with(Origin::near(scene.bounds()), scene, light, !self.params.skip)
    }

    /// [`prepare`](Self::prepare) in coordinates counted from a place, with the faces that each texel lists if `by_texels`.
    fn prepare_with<'a>(
        &self,
        counted_from: Origin,
        scene: &'a Scene,
        light: &Light,
        by_texels: bool,
    ) -> Result<(PreparedDdoc<'a>, Report), TopologyError> {
        let (mut report, params) = (Report::default(), &self.params);
        let (moved, light) = (counted_from.scene(scene), &counted_from.light(light));
        let scene = moved.as_ref();
        let tolerance = plane_tolerance(scene.bounds(), light);
        let center = light.center();
        let (casters, images) = report.time("prepare.views", |_| {
            let casters = relevance::told_apart(scene, light, tolerance);
            // A penumbra reaches from one face of a cube into the next: none is left out.
            let views = light_views(scene, light, &casters.drawn, false).views;
            let images: Vec<_> =
                views.into_iter().map(|view| LightImage::new(view, params.map_size)).collect();
            (casters, images)
        });
        report.skip("casters", casters.backdrops.len() as u64);
        // What one shadow map shows.
        let single = matches!(params.variant, Variant::ImageEdges | Variant::Paper);
        let of = |solid: bool| -> Vec<_> {
            let is_solid = |object: &Object| !single && object.alpha.is_none();
            let chosen = casters.drawn.iter().filter(|object| is_solid(object) == solid);
            chosen.map(|object| object.triangles.clone()).filter(|range| !range.is_empty()).collect()
        };
        let (faces, mut layers) = report.time("prepare.map", |_| {
            let solid = of(true);
            let lone = images.len() == 1;
            // Blocks of receivers choose faces as they choose edges, by tiles; one receiver alone asks all over its texel.
            let grid_of = |size: u32, count: usize| {
                if by_texels { Grid::of_texels(size, count) } else { Grid::new(size, lone) }
            };
            let of_view =
                |image: &LightImage| Faces::new(scene, &solid, image, |count| grid_of(image.size, count));
            let faces: Vec<_> = images.iter().map(of_view).collect();
            (faces, cpu::draw_layers(scene, &of(false), &images, single))
        });
        let bounds = casters.drawn.iter().fold(Aabb::EMPTY, |all, object| all.union(object.bounds));
        let origin = if bounds.is_empty() { Vec3::ZERO } else { bounds.center() };
        let (hull, center_hull) = (LightHull::of(light), LightHull::of(&center.as_light()));
        let (edges, first_outline) = report.time("prepare.silhouettes", |report| {
            let mut edges = match params.variant {
                Variant::ImageEdges | Variant::Paper => Vec::new(),
                // Without extent there are no penumbrae: V is what lies before the centre.
                _ if params.skip && !light.is_extended() => {
                    report.skip("casters without a penumbra", casters.drawn.len() as u64);
                    Vec::new()
                }
                Variant::Ddoc => object_edges(scene, &casters.drawn, origin, hull.as_ref(), center, report)?,
                Variant::Smoothies | Variant::PenumbraMap => {
                    let mut edges =
                        object_edges(scene, &casters.drawn, origin, center_hull.as_ref(), center, report)?;
                    edges.retain(|edge| edge.from_center != 0);
                    edges
                }
            };
            let first_outline = edges.len();
            for layers in &mut layers {
                let in_map = || Discontinuities::new(scene, layers, center, tolerance);
                let outlines = match params.variant {
                    Variant::Paper => {
                        edges.extend(paper::texel_splats(&in_map(), origin, scene.bounds()));
                        continue;
                    }
                    Variant::ImageEdges => image_edges::image_edges(&in_map(), origin),
                    _ => mask_edges::mask_edges(scene, origin, layers, center),
                };
                layers.set_outlines(&outlines, edges.len() as u32, origin);
                edges.extend(outlines);
            }
            Ok::<_, TopologyError>((edges, first_outline))
        })?;
        report.bytes += layers.iter().map(|layers| layers.bytes() as u64).sum::<u64>()
            + faces.iter().map(|faces| faces.lists().bytes() as u64).sum::<u64>()
            + size_of_val(&edges[..]) as u64;
        let base = LightMaps {
            origin: counted_from,
            backdrops: casters.backdrops.into_iter().cloned().collect(),
            scene: moved,
            light: *light,
            maps: Vec::new(),
            tolerance,
        };
        let points = light_points::light_points(light, params.taps, params.seed);
        let DdocParams { variant, skip, .. } = *params;
        let prepared = PreparedDdoc {
            base,
            faces,
            layers,
            origin,
            edges,
            first_outline,
            hull,
            center_hull,
            points,
            variant,
            skip,
        };
        Ok((prepared, report))
    }
}

/// The silhouettes of solid casters for any point of the light within `hull`.
fn object_edges(
    scene: &Scene,
    casters: &[&Object],
    origin: Vec3,
    hull: Option<&LightHull>,
    center: LightPoint,
    report: &mut Report,
) -> Result<Vec<Edge>, TopologyError> {
    let drawn: HashSet<usize> = casters.iter().map(|object| object.triangles.start).collect();
    let found = silhouettes(scene, origin, hull, center, |object| {
        object.alpha.is_none() && !object.triangles.is_empty() && drawn.contains(&object.triangles.start)
    })?;
    report.skip("edges", found.left_out);
    Ok(found.edges)
}

impl PreparedDdoc<'_> {
    /// What has its edges from the map, a view each.
    pub fn layers(&self) -> &[Layers] {
        &self.layers
    }

    /// The edges that bound penumbrae, from [`origin`](Self::origin).
    pub fn edges(&self) -> &[Edge] {
        &self.edges
    }

    /// Where edges are counted from: in world space or, of a scene that lies far from zero, in its own ([`Origin`]).
    pub fn origin(&self) -> Vec3 {
        self.origin
    }

    /// Fills `visibility`, which must have the G-buffer's size: V where a surface is seen, NaN elsewhere.
    pub fn shade(&self, gbuffer: &GBuffer, visibility: &mut VisibilityImage) -> Report {
        let mut report = Report::default();
        let gbuffer = self.base.origin.gbuffer(gbuffer);
        cpu::shade(self, &mut visibility.values, &mut report, |pixel| receiver(&self.base, &gbuffer, pixel));
        report
    }

    /// V at free points, each answered as a small surface turned to the light's centre; NaN for a point that is not
    /// finite. The slices must be of equal length: what the longer one has more is left alone.
    pub fn visibility_at(&self, points: &[Vec3], visibility: &mut [f32]) -> Report {
        let mut report = Report::default();
        let count = points.len().min(visibility.len());
        let (light, base) = (&self.base.light, &self.base);
        cpu::shade(self, &mut visibility[..count], &mut report, |index| {
            let point = base.origin.point(points[index]);
            if !point.is_finite() {
                return Err(f32::NAN);
            }
            if !light.reaches(point) || base.is_behind_backdrop(point) {
                return Err(0.0);
            }
            let (to_light, _) = light.center().ray_from(point);
            let (normal, tolerance) = (to_light.normalize_or_zero(), base.tolerance);
            Ok(Receiver { point, normal, object: GBuffer::NOTHING, tolerance, pixel: [0; 2] })
        });
        report
    }
}
