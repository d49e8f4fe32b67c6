//! Shadow volumes of one light for one view: silhouettes, the groups that casters are counted in, caps.

use std::ops::Range;
use std::sync::Arc;

use fearless_simd::{Level, dispatch};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use scene_core::bvh::Bvh;
use scene_core::geometry::facing_of;
use scene_core::{Camera, Light, Report};

use crate::bounds::{LANES, SideGroup};
use crate::casters::{Casters, near_box, near_casters};
use crate::crossing::SideFromApex;
use crate::crossing::{Edge, HomogeneousLight, back_cap, cap_crossing, crossing};
use crate::masked::MaskedCasters;
use crate::outline::{Screen, ScreenEdge};
use crate::params::{Count, VolumeParams};
use crate::runs::{RUN, Runs, Shaft};
use crate::silhouette::extract_within;
use crate::skips::Skips;

/// A face turned to the light.
#[derive(Clone, Copy, Debug)]
pub struct Cap {
    /// Its corners.
    pub corners: [DVec3; 3],
    /// +1 if the light sees them counter-clockwise, −1 if clockwise.
    pub facing: i8,
}

/// The volumes of all casters that matter, ready to be counted.
#[derive(Debug)]
pub struct Volumes {
    /// The light's middle.
    pub light: HomogeneousLight,
    /// Silhouette edges: first those of casters counted from the eye, then of those counted from infinity.
    pub edges: Vec<Edge>,
    /// How many are counted from the eye.
    pub from_eye: usize,
    /// Half-spaces of their sides, eight to a group.
    pub sides: Vec<SideGroup>,
    /// The edges on the screen.
    pub outlines: Vec<ScreenEdge>,
    /// The edges by runs, with bounds if these are asked.
    pub runs: Runs,
    /// The faces of casters counted from infinity.
    pub caps: Vec<Cap>,
    /// Faces that may lie between the eye and the near plane, where they are not seen.
    pub near_caps: Vec<Cap>,
    /// The view.
    pub screen: Screen,
    /// The near plane's depth.
    pub near: f64,
    /// The casters' tree.
    pub tree: Arc<Bvh>,
    /// Where casters are that are not counted.
    pub masked: MaskedCasters,
    /// Sides a tile above which its pixels are traced.
    pub dense: u32,
    /// Whether there are so many edges that all pixels are traced; then none is kept.
    pub all_dense: bool,
}

/// Sides a tile above which its pixels are traced: to count a side at 64 pixels takes some 100 ns, a ray 150.
pub const DENSE: u32 = 96;

/// Silhouette edges above which all pixels are traced. Each block of 64² pixels starts with a count of all sides, a few
/// nanoseconds each: with more sides than an eighth of the pixels that alone is longer than a ray a pixel.
pub fn most_edges(camera: &Camera) -> usize {
    camera.pixel_count() / 8
}

impl Volumes {
    /// The volumes of `light` for `camera`.
    pub fn new(
        casters: &Casters<'_>,
        light: &Light,
        camera: &Camera,
        (params, skips): (&VolumeParams, &Skips),
        report: &mut Report,
    ) -> Self {
        let VolumeParams { count, rays, .. } = *params;
        let scene = casters.scene;
        let relevant =
            report.time("prepare.relevance", |report| casters.relevant(light, camera, skips, report));
        let facing = report.time("prepare.facing", |_| facing_in(casters, &relevant, light));
        let near = report.time("prepare.relevance", |_| near_casters(casters, light, camera));
        let split = match count {
            // Nothing is proved: all casters need their caps.
            Count::Auto if !skips.caps => Split::new(casters, &facing, &near, Count::ZFail),
            count => Split::new(casters, &facing, &near, count),
        };
        let most = if rays { most_edges(camera) } else { usize::MAX };
        let found = report.time("prepare.silhouette", |_| {
            let edges = (&casters.topology, &casters.runs);
            let of = |facing: &Option<Vec<i8>>, most: usize| match facing {
                Some(facing) => extract_within(edges, scene.positions(), facing, &relevant, most),
                None => Some(Vec::new()),
            };
            let mut found = of(&split.from_eye, most)?;
            let from_eye = found.len();
            found.extend(of(&split.from_infinity, most - from_eye)?);
            Some((found, from_eye))
        });
        let all_dense = found.is_none();
        let (edges, from_eye) = found.unwrap_or_default();
        let homogeneous = HomogeneousLight::from(light.center());
        let screen = Screen::new(camera);
        let (sides, outlines, runs) = report.time("prepare.sides", |_| {
            let sides: Vec<_> =
                edges.par_chunks(LANES).with_min_len(64).map(|e| SideGroup::new(e, &homogeneous)).collect();
            let outlines: Vec<_> = edges.par_iter().with_min_len(512).map(|e| screen.project(e)).collect();
            let runs = match skips.bounded {
                true => Runs::bounded(&edges, &outlines),
                false => Runs::unbounded(edges.len()),
            };
            (sides, outlines, runs)
        });
        let turned = split.from_infinity.as_deref().filter(|_| !all_dense).unwrap_or(&[]);
        let caps: Vec<_> = report.time("prepare.caps", |_| {
            let caps = (0..turned.len()).into_par_iter().with_min_len(4096);
            caps.filter(|&t| turned[t] != 0).map(|t| cap(casters, t, turned[t])).collect()
        });
        let all = facing.iter().filter(|&&f| f != 0).count();
        report.skip("caps", (all - caps.len()) as u64);
        // With z-pass on its own nothing is looked for before the near plane.
        let near_caps = if count == Count::ZPass || all_dense {
            Vec::new()
        } else {
            let bounds = near_box(camera);
            let objects = near.iter().map(|&id| scene.objects()[id as usize].triangles.clone());
            let triangles = objects.flatten().filter(|&t| facing[t] != 0);
            let touching = triangles.filter(|&t| {
                let corners = scene.corners(t);
                let (low, high) =
                    (corners[0].min(corners[1]).min(corners[2]), corners[0].max(corners[1]).max(corners[2]));
                low.cmple(bounds.max).all() && high.cmpge(bounds.min).all()
            });
            touching.map(|t| cap(casters, t, facing[t])).collect()
        };
        Self {
            light: homogeneous,
            edges,
            from_eye,
            sides,
            outlines,
            runs,
            caps,
            near_caps,
            screen,
            near: f64::from(camera.near),
            tree: casters.tree.clone(),
            masked: casters.masked.clone(),
            dense: if rays { DENSE } else { u32::MAX },
            all_dense,
        }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.edges[..])
            + size_of_val(&self.sides[..])
            + size_of_val(&self.outlines[..])
            + self.runs.bytes()
            + size_of_val(&self.caps[..])
            + size_of_val(&self.near_caps[..])
    }

    /// How many faces lie between the light and each of the points, counted from the eye and from infinity as the
    /// casters' groups say. A point has its place and what is needed to see it: [`Start`].
    pub fn count_starts(&self, starts: &[Start], counts: &mut [i32]) {
        let level = Level::new();
        let partial = |parts: Vec<Vec<i32>>, counts: &mut [i32]| {
            for part in parts {
                counts.iter_mut().zip(part).for_each(|(count, part)| *count += part);
            }
        };
        let sum_of = |edges: Range<usize>, from_eye: bool| -> Vec<Vec<i32>> {
            let groups = edges.start / (RUN * LANES)..edges.end.div_ceil(RUN * LANES);
            let groups = groups.into_par_iter().filter(|_| !edges.is_empty());
            groups
                .map(|group| {
                    let mut sums = vec![0; starts.len()];
                    dispatch!(level, simd => {
                        let within: Vec<u32> = starts
                            .iter()
                            .map(|start| {
                                let way = if from_eye { start.from_eye } else { start.onward };
                                self.runs.within(simd, group, &Shaft::plane(start.place, way, &self.light))
                            })
                            .collect();
                        for run in 0..LANES {
                            let range = self.runs.edges(group * LANES + run);
                            let range = range.start.max(edges.start)..range.end.min(edges.end);
                            let across = |&index: &usize| within[index] >> run & 1 == 1;
                            let across: Vec<usize> = (0..starts.len()).filter(across).collect();
                            self.add_sides(simd, range, from_eye, (starts, &across), &mut sums);
                        }
                    });
                    sums
                })
                .collect()
        };
        partial(sum_of(0..self.from_eye, true), counts);
        partial(sum_of(self.from_eye..self.edges.len(), false), counts);
        let caps: Vec<Vec<i32>> = self
            .caps
            .par_chunks(CAPS_A_TASK)
            .map(|caps| {
                let mut sums = vec![0; starts.len()];
                dispatch!(level, simd => self.add_caps(simd, caps, starts, &mut sums));
                sums
            })
            .collect();
        partial(caps, counts);
    }

    #[inline(always)]
    fn add_sides<S>(
        &self,
        _simd: S,
        range: Range<usize>,
        from_eye: bool,
        (starts, across): (&[Start], &[usize]),
        sums: &mut [i32],
    ) {
        for index in range {
            let (edge, outline) = (&self.edges[index], &self.outlines[index]);
            let plane = edge.plane(&self.light);
            let eye = self.screen.eye;
            let side = SideFromApex::new(edge, &self.light, eye);
            let eye_outside = edge.is_outside(plane, eye);
            for &start in across {
                let (start, sum) = (&starts[start], &mut sums[start]);
                let outside = edge.is_outside(plane, start.place);
                if from_eye {
                    if outside != eye_outside {
                        let beyond = outline.is_right(start.from_eye);
                        let crossed = crossing(&side, start.from_eye, beyond, eye_outside, outside);
                        *sum += edge.multiplicity * crossed;
                    }
                } else {
                    // From the point on to infinity: what is left of the way is taken off.
                    let way = start.onward;
                    let ends = plane.dot(way) >= 0.0;
                    if ends != outside {
                        let side = SideFromApex::new(edge, &self.light, start.place);
                        let beyond = side.edge.dot(way) >= 0.0;
                        *sum -= edge.multiplicity * crossing(&side, way, beyond, outside, ends);
                    }
                }
            }
        }
    }

    #[inline(always)]
    fn add_caps<S>(&self, _simd: S, caps: &[Cap], starts: &[Start], sums: &mut [i32]) {
        for cap in caps {
            for (start, sum) in starts.iter().zip(&mut *sums) {
                *sum -= cap_crossing(cap.corners, cap.facing, start.place, start.onward);
                if !self.light.at_infinity {
                    *sum += back_cap(cap.corners, cap.facing, self.light.point, start.onward);
                }
            }
        }
    }

    /// Whether the way from the eye to a seen point crosses a cap before the near plane, or so little beyond it that the
    /// rasteriser, which tests depths where it has snapped a pixel to, might have left it out.
    pub fn crosses_near_cap(&self, from_eye: DVec3) -> bool {
        /// A pixel's depth is that of a point at most 2⁻⁹ pixel beside it; a surface would have to change its depth by
        /// more than its distance a pixel for this not to hold it.
        const SNAPPED: f64 = 1.0 + 1.0 / 256.0;
        let depth = self.screen.depth(from_eye);
        self.near_caps.iter().any(|cap| {
            let [a, b, c] = cap.corners;
            let normal = (b - a).cross(c - a);
            let t = normal.dot(a - self.screen.eye) / normal.dot(from_eye);
            t < 1.0
                && t * depth < self.near * SNAPPED
                && cap_crossing(cap.corners, cap.facing, self.screen.eye, from_eye) != 0
        })
    }
}

/// Caps of a task of [`Volumes::count_starts`].
const CAPS_A_TASK: usize = 1024;

/// A point at which counting starts anew.
#[derive(Clone, Copy, Debug)]
pub struct Start {
    /// Its place.
    pub place: DVec3,
    /// The same, seen from the eye.
    pub from_eye: DVec3,
    /// The way on from it to infinity: along the view, if that is not the way light travels.
    pub onward: DVec3,
}

impl Start {
    /// A start at `place`, which lies at `from_eye` from the eye.
    pub fn new(place: DVec3, from_eye: DVec3, light: &HomogeneousLight) -> Self {
        let mut onward = from_eye;
        // Straight away from a light at infinity all is seen edge-on; any other direction will do.
        let across = onward.cross(light.point).length();
        if light.at_infinity && across <= 1e-3 * onward.length() * light.point.length() {
            onward = light.point.any_orthonormal_vector() + 0.5 * light.point.normalize_or_zero();
        }
        Self { place, from_eye, onward }
    }
}

fn cap(casters: &Casters<'_>, triangle: usize, facing: i8) -> Cap {
    Cap { corners: casters.scene.corners(triangle).map(Vec3::as_dvec3), facing }
}

/// The facing of every triangle in `ranges`, 0 for all others and for those that do not cast.
fn facing_in(casters: &Casters<'_>, ranges: &[Range<usize>], light: &Light) -> Vec<i8> {
    /// Triangles a task.
    const CHUNK: usize = 1 << 13;
    let scene = casters.scene;
    let mut facing = vec![0; scene.triangles().len()];
    let center = light.center();
    facing.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, facing)| {
        let start = chunk * CHUNK;
        let end = start + facing.len();
        let first = ranges.partition_point(|range| range.end <= start);
        for range in ranges[first..].iter().take_while(|range| range.start < end) {
            for triangle in range.start.max(start)..range.end.min(end) {
                facing[triangle - start] = facing_of(scene.corners(triangle), center);
            }
        }
    });
    // A range may run over objects that do not cast. Those with masks are not counted.
    for object in scene.objects().iter().filter(|object| !object.flags.casts || object.alpha.is_some()) {
        facing[object.triangles.clone()].fill(0);
    }
    facing
}

/// Facings by how the casters are counted; `None` for a group without casters.
struct Split {
    from_eye: Option<Vec<i8>>,
    from_infinity: Option<Vec<i8>>,
}

impl Split {
    fn new(casters: &Casters<'_>, facing: &[i8], near: &[u32], count: Count) -> Self {
        let whole = Some(facing.to_vec());
        match count {
            Count::ZPass => Self { from_eye: whole, from_infinity: None },
            Count::ZFail => Self { from_eye: None, from_infinity: whole },
            Count::Auto if near.is_empty() => Self { from_eye: whole, from_infinity: None },
            Count::Auto => {
                let (mut far, mut close) = (facing.to_vec(), vec![0; facing.len()]);
                for &id in near {
                    let triangles = casters.scene.objects()[id as usize].triangles.clone();
                    close[triangles.clone()].copy_from_slice(&facing[triangles.clone()]);
                    far[triangles].fill(0);
                }
                Self { from_eye: Some(far), from_infinity: Some(close) }
            }
        }
    }
}
