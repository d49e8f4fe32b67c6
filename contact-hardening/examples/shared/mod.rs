//! What the examples share: scenes by name or file, ground truth, processor time, charts.

#![allow(dead_code, reason = "each example takes what it needs")]

use std::error::Error;
use std::fmt::Write as _;
use std::path::Path;
use std::time::Instant;

use gnomon_contact_hardening::{ContactHardeningParams, Scaling, Variant};
use scene_core::bvh::Bvh;
use scene_core::reference::{self, ReferenceSettings, no_progress};
use scene_core::technique::{ShadowQuery, ShadowTechnique};
use scene_core::{GBuffer, SceneSetup, VisibilityImage, io, metrics, raster, scenes};

/// A scene as a camera sees it, and the truth about it.
pub(crate) struct Case {
    /// Name or file stem.
    pub(crate) name: String,
    /// Scene, camera, lights.
    pub(crate) setup: SceneSetup,
    /// Surfaces.
    pub(crate) gbuffer: GBuffer,
    /// Ground truth.
    pub(crate) truth: VisibilityImage,
    /// Pixels that are compared.
    pub(crate) valid: Vec<bool>,
}

impl Case {
    /// A built-in scene's spec or a scene file, in pictures of `size` pixels, with `samples` rays a pixel.
    pub(crate) fn new(spec: &str, size: [u32; 2], samples: u32) -> Result<Self, Box<dyn Error>> {
        let path = Path::new(spec);
        let mut setup = if path.is_file() { io::load_setup(path)? } else { scenes::build(spec, 0.0)? };
        [setup.camera.width, setup.camera.height] = size;
        let gbuffer = raster::render_gbuffer(&setup.scene, &setup.camera);
        let light = &setup.lights[0];
        let sampling = ReferenceSettings { samples, ..Default::default() };
        let casters = Bvh::casters(&setup.scene);
        let truth = reference::reference(&setup.scene, &casters, light, &gbuffer, &sampling, &no_progress)?
            .visibility;
        let valid = reference::valid_pixels(&gbuffer, light);
        let stem = path.file_stem().filter(|_| path.is_file());
        let name = stem.map_or(spec.into(), |stem| stem.to_string_lossy().into_owned());
        Ok(Self { name, setup, gbuffer, truth, valid })
    }

    /// The picture of a technique, and the milliseconds of preparing and shading it: processor time, where the system
    /// tells it.
    pub(crate) fn run(
        &self,
        technique: &dyn ShadowTechnique,
    ) -> Result<(VisibilityImage, f64), Box<dyn Error>> {
        let SceneSetup { scene, camera, lights, .. } = &self.setup;
        let query = ShadowQuery { scene, light: &lights[0], camera };
        let mut image = VisibilityImage::new(self.gbuffer.width, self.gbuffer.height);
        let clock = Clock::start();
        technique.prepare(&query)?.0.shade(&self.gbuffer, &mut image)?;
        Ok((image, clock.milliseconds()))
    }

    /// Errors of a picture.
    pub(crate) fn errors(&self, image: &VisibilityImage) -> Result<metrics::Errors, metrics::MetricsError> {
        metrics::errors(image, &self.truth, &self.valid)
    }
}

/// Processor time of all threads, or wall time where the system does not tell it.
pub(crate) struct Clock {
    wall: Instant,
    processor: Option<u64>,
}

impl Clock {
    /// Starts now.
    pub(crate) fn start() -> Self {
        Self { wall: Instant::now(), processor: processor_nanoseconds() }
    }

    /// Since the start.
    pub(crate) fn milliseconds(&self) -> f64 {
        match (self.processor, processor_nanoseconds()) {
            (Some(start), Some(end)) => (end - start) as f64 * 1e-6,
            _ => self.wall.elapsed().as_secs_f64() * 1e3,
        }
    }
}

/// What Linux says that the threads of this process have run.
fn processor_nanoseconds() -> Option<u64> {
    let threads = std::fs::read_dir("/proc/self/task").ok()?;
    let of = |thread: std::fs::DirEntry| -> Option<u64> {
        let text = std::fs::read_to_string(thread.path().join("schedstat")).ok()?;
        text.split_whitespace().next()?.parse().ok()
    };
    threads.map(|thread| of(thread.ok()?)).sum()
}

/// Pictures of one size, `columns` a row, two pixels apart.
pub(crate) fn in_rows(images: &[VisibilityImage], columns: usize) -> VisibilityImage {
    const GAP: usize = 2;
    let (width, height) =
        images.first().map_or((0, 0), |image| (image.width as usize, image.height as usize));
    let columns = columns.min(images.len()).max(1);
    let rows = images.len().div_ceil(columns);
    let mut all = VisibilityImage::new(
        (columns * (width + GAP)).saturating_sub(GAP) as u32,
        (rows * (height + GAP)).saturating_sub(GAP) as u32,
    );
    all.values.fill(1.0);
    for (index, image) in images.iter().enumerate() {
        let place = index / columns * (height + GAP) * all.width as usize + index % columns * (width + GAP);
        for (row, values) in image.values.chunks(width.max(1)).enumerate() {
            all.values[place + row * all.width as usize..][..width].copy_from_slice(values);
        }
    }
    all
}

/// Every other picture of the paper has these: its own passes and nothing that it does not have.
pub(crate) fn as_published(variant: Variant, multiplier: f32) -> ContactHardeningParams {
    ContactHardeningParams {
        variant,
        scaling: Scaling::Paper,
        geometry: false,
        fill: false,
        smooth: false,
        taps: 20,
        distance_multiplier: multiplier,
        ..Default::default()
    }
}

/// A curve of a chart: its name, and points.
pub(crate) type Curve = (String, Vec<[f64; 2]>);

/// A chart with linear axes from zero, as SVG.
pub(crate) fn chart(title: &str, axes: [&str; 2], curves: &[Curve]) -> String {
    const COLORS: [&str; 5] = ["#1b6ca8", "#c8553d", "#588157", "#7b2d8b", "#8d6a00"];
    let (width, height, left, low) = (640.0, 360.0, 64.0, 48.0);
    let greatest = |axis: usize| {
        curves.iter().flat_map(|(_, points)| points).map(|p| p[axis]).fold(f64::MIN_POSITIVE, f64::max)
    };
    let steps = [0, 1].map(|axis| step(greatest(axis)));
    let ends = [0, 1].map(|axis| (greatest(axis) / steps[axis]).ceil() * steps[axis]);
    let place = |[x, y]: [f64; 2]| {
        let right = width - 16.0;
        [left + x / ends[0] * (right - left), height - low - y / ends[1] * (height - low - 36.0)]
    };
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" \
         font-size=\"12\">\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n<text x=\"{left}\" y=\"20\" \
         font-size=\"14\">{title}</text>\n"
    );
    // Writing to a string cannot fail.
    for axis in [0, 1] {
        for index in 0..=(ends[axis] / steps[axis]).round() as u32 {
            let value = f64::from(index) * steps[axis];
            let (from, to) = if axis == 0 {
                (place([value, 0.0]), place([value, ends[1]]))
            } else {
                (place([0.0, value]), place([ends[0], value]))
            };
            let (x, y, anchor) = if axis == 0 {
                (from[0], from[1] + 16.0, "middle")
            } else {
                (from[0] - 6.0, from[1] + 4.0, "end")
            };
            let label = (value * 1e6).round() * 1e-6;
            let _ = writeln!(
                svg,
                "<path d=\"M{:.1} {:.1}L{:.1} {:.1}\" stroke=\"#ddd\"/><text x=\"{x:.1}\" y=\"{y:.1}\" \
                 text-anchor=\"{anchor}\">{label}</text>",
                from[0], from[1], to[0], to[1]
            );
        }
    }
    let _ = writeln!(
        svg,
        "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text>\n<text transform=\"translate(14 {}) rotate(-90)\" \
         text-anchor=\"middle\">{}</text>",
        0.5 * (left + width),
        height - 12.0,
        axes[0],
        0.5 * (height - 12.0),
        axes[1]
    );
    for (index, (name, points)) in curves.iter().enumerate() {
        let color = COLORS[index % COLORS.len()];
        let line: Vec<String> =
            points.iter().map(|&point| place(point)).map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
        let _ = writeln!(
            svg,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"2\"/>",
            line.join(" ")
        );
        for [x, y] in points.iter().map(|&point| place(point)) {
            let _ = writeln!(svg, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\" fill=\"{color}\"/>");
        }
        let y = 48.0 + 16.0 * index as f64;
        let _ = writeln!(svg, "<text x=\"{}\" y=\"{y}\" fill=\"{color}\">{name}</text>", left + 24.0);
    }
    svg + "</svg>\n"
}

/// A round step that divides a range in five to ten.
fn step(range: f64) -> f64 {
    let power = 10f64.powf((range / 10.0).log10().ceil());
    [0.2, 0.5, 1.0].into_iter().map(|share| share * power).find(|step| range / step <= 10.0).unwrap_or(power)
}
