//! What a file holds after its header: settings, light, and window by window where its rays are, index and data.

use glam::{Vec2, Vec3};
use scene_core::Light;

use super::words::{Reader, Writer};
use super::{Baked, Fingerprint};
use crate::compression::Segments;
use crate::cpu::Window;
use crate::functions::{Functions, Statistics};
use crate::grid::PixelGrid;
use crate::layout::{Depth, Layout, Placement};
use crate::nodes::{DepthSteps, Nodes};
use crate::params::{ErrorMeasure, PdsmParams, Precision};

/// Largest filter.
const MOST_RADIUS: u32 = 16;

/// Most windows of a light.
const MOST_WINDOWS: u32 = 6;

pub(super) fn write(baked: &Baked, to: &mut Writer) {
    let PdsmParams {
        views,
        map_size,
        pdsm_size,
        max_error,
        error_measure,
        segments,
        bilinear,
        filter_radius,
        precision,
        only_surfaces,
        skip,
        seed,
        // A file is for any camera.
        cascades: _,
    } = baked.params;
    for value in [views, map_size, pdsm_size, filter_radius] {
        to.u32(value);
    }
    to.f32s(&[max_error]);
    let display = error_measure == ErrorMeasure::Display;
    let fewest = segments == Segments::Fewest;
    for flag in [display, fewest, bilinear, precision == Precision::Half, only_surfaces, skip] {
        to.u32(u32::from(flag));
    }
    to.u64(seed);
    write_light(&baked.light, to);
    to.f32s(&[baked.tolerance]);
    for value in [baked.fingerprint.casters, baked.fingerprint.all] {
        to.u32(value);
    }
    to.u32(baked.windows.len() as u32);
    for window in baked.windows.iter() {
        write_window(window, to);
    }
}

/// `None` where the words are not what [`write`] makes.
pub(super) fn read(from: &mut Reader<'_>) -> Option<Baked> {
    let [views, map_size, pdsm_size] = [from.u32()?, from.u32()?, from.u32()?];
    let filter_radius = from.u32().filter(|radius| (1..=MOST_RADIUS).contains(radius))?;
    let [max_error] = from.finite()?;
    let [display, fewest, bilinear, half] = [from.bool()?, from.bool()?, from.bool()?, from.bool()?];
    let segments = if fewest { Segments::Fewest } else { Segments::Greedy };
    let [only_surfaces, skip] = [from.bool()?, from.bool()?];
    let error_measure = if display { ErrorMeasure::Display } else { ErrorMeasure::Visibility };
    let precision = if half { Precision::Half } else { Precision::Full };
    let seed = from.u64()?;
    let params = PdsmParams {
        views,
        map_size,
        pdsm_size,
        max_error,
        error_measure,
        segments,
        bilinear,
        filter_radius,
        precision,
        only_surfaces,
        skip,
        seed,
        cascades: 0,
    };
    let light = read_light(from)?;
    let [tolerance] = from.finite()?;
    let fingerprint = Fingerprint { casters: from.u32()?, all: from.u32()? };
    let count = from.u32().filter(|&count| count <= MOST_WINDOWS)?;
    let windows = (0..count).map(|_| read_window(from)).collect::<Option<Vec<_>>>()?;
    from.words.is_empty().then(|| Baked { params, light, tolerance, fingerprint, windows: windows.into() })
}

fn write_light(light: &Light, to: &mut Writer) {
    let mut put = |kind: u32, vectors: &[Vec3], numbers: &[f32]| {
        to.u32(kind);
        to.f32s(bytemuck::cast_slice(vectors));
        to.f32s(numbers);
    };
    match *light {
        Light::Directional { direction, angular_radius } => put(0, &[direction], &[angular_radius]),
        Light::Point { position } => put(1, &[position], &[]),
        Light::Spot { position, direction, outer, inner } => put(2, &[position, direction], &[outer, inner]),
        Light::Sphere { center, radius } => put(3, &[center], &[radius]),
        Light::Rect { center, half_u, half_v } => put(4, &[center, half_u, half_v], &[]),
        Light::Disk { center, normal, radius } => put(5, &[center, normal], &[radius]),
    }
}

fn read_light(from: &mut Reader<'_>) -> Option<Light> {
    let kind = from.u32()?;
    let mut vector = || from.finite().map(Vec3::from_array);
    let light = match kind {
        0 => {
            let direction = vector()?;
            Light::Directional { direction, angular_radius: from.f32()? }
        }
        1 => Light::Point { position: vector()? },
        2 => {
            let [position, direction] = [vector()?, vector()?];
            Light::Spot { position, direction, outer: from.f32()?, inner: from.f32()? }
        }
        3 => {
            let center = vector()?;
            Light::Sphere { center, radius: from.f32()? }
        }
        4 => Light::Rect { center: vector()?, half_u: vector()?, half_v: vector()? },
        5 => {
            let [center, normal] = [vector()?, vector()?];
            Light::Disk { center, normal, radius: from.f32()? }
        }
        _ => return None,
    };
    light.validate().is_ok().then_some(light)
}

fn write_window(window: &Window, to: &mut Writer) {
    let Placement { origin, axes, depth, corner, texels_per_unit, max_tan, reach, part: _ } =
        &window.layout.placement;
    to.f32s(&origin.to_array());
    to.f32s(bytemuck::cast_slice(axes));
    match *depth {
        Depth::Central { focus } => to.f32s(&[focus, 0.0]),
        Depth::Parallel { focus, per_unit } => to.f32s(&[focus, per_unit]),
    }
    for vector in [*corner, *texels_per_unit, *reach] {
        to.f32s(&vector.to_array());
    }
    to.f32s(&[*max_tan]);
    window.layout.caster_range.iter().for_each(|&z| to.f64(z));
    to.u32(window.layout.offsets.len() as u32);
    to.f32s(bytemuck::cast_slice(&window.layout.offsets));
    to.u32(window.grid.size);
    to.u32(window.grid.ratio);
    let statistics = window.functions.statistics();
    to.u64(statistics.events);
    to.u32(statistics.most_events);
    to.u32(statistics.most_nodes);
    let nodes = window.functions.nodes();
    match nodes {
        Nodes::Full(_) => to.u32(0),
        Nodes::Packed(_, DepthSteps { start, step }) => {
            to.u32(1);
            to.f32s(&[*start, *step]);
        }
    }
    to.u32(nodes.len() as u32);
    to.words.extend_from_slice(window.functions.index());
    to.words.extend_from_slice(nodes.words());
}

fn read_window(from: &mut Reader<'_>) -> Option<Window> {
    let mut vector = || from.finite().map(Vec3::from_array);
    let origin = vector()?;
    let axes = [vector()?, vector()?, vector()?];
    let [focus, per_unit] = from.finite()?;
    let depth = if per_unit == 0.0 { Depth::Central { focus } } else { Depth::Parallel { focus, per_unit } };
    let mut pair = || from.finite().map(Vec2::from_array);
    let [corner, texels_per_unit, reach] = [pair()?, pair()?, pair()?];
    let max_tan = from.f32().filter(|tan| *tan > 0.0)?;
    let caster_range = [from.f64()?, from.f64()?];
    let offsets = from.u32()? as usize;
    let offsets: Vec<Vec2> = bytemuck::cast_slice(from.take(offsets.checked_mul(2)?)?).to_vec();
    if !offsets.iter().all(|offset| offset.is_finite()) {
        return None;
    }
    let grid = PixelGrid { size: from.u32()?, ratio: from.u32().filter(|&ratio| ratio > 0)? };
    let map_size = grid.size.checked_mul(grid.ratio).filter(|&size| size > 0)?;
    let statistics = Statistics { events: from.u64()?, most_events: from.u32()?, most_nodes: from.u32()? };
    let steps = match from.bool()? {
        false => None,
        true => {
            let [start, step] = from.finite()?;
            (step > 0.0).then_some(Some(DepthSteps { start, step }))?
        }
    };
    let count = from.u32()? as usize;
    let pixels = (grid.size as usize).checked_mul(grid.size as usize)?;
    let index = from.take(pixels.checked_add(1)?)?.to_vec();
    let nodes = match steps {
        None => Nodes::Full(bytemuck::cast_slice(from.take(count.checked_mul(2)?)?).to_vec()),
        Some(steps) => Nodes::Packed(bytemuck::cast_slice(from.take(count)?).to_vec(), steps),
    };
    let functions = Functions::from_parts(grid.size, index, nodes, statistics)?;
    let placement = Placement { origin, axes, depth, corner, texels_per_unit, max_tan, reach, part: None };
    let layout = Layout { placement, map_size, caster_range, offsets };
    Some(Window { layout, grid, functions })
}
