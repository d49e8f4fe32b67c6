//! `report.json`: what was run, on what, and what it cost.

use std::collections::BTreeMap;

use scene_core::{Light, Report};
use serde::Serialize;
use serde_json::Value;

use crate::backend::Side;
use crate::scene_source::View;

/// Which light of the scene was looked at.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct LightReport {
    /// Its place in the scene's list.
    pub(crate) index: usize,
    /// Its kind, as in a scene file.
    pub(crate) kind: &'static str,
    /// Whether it throws penumbrae.
    pub(crate) extended: bool,
}

impl LightReport {
    pub(crate) fn new(index: usize, light: &Light) -> Self {
        Self { index, kind: light.kind(), extended: light.is_extended() }
    }
}

/// One run of a technique, or of ground truth.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct RunReport {
    /// The scene's name.
    pub(crate) scene: String,
    /// The light.
    pub(crate) light: LightReport,
    /// The technique's name, or `reference`.
    pub(crate) technique: String,
    /// The mode of it.
    pub(crate) variant: String,
    /// `cpu` or `gpu`.
    pub(crate) backend: &'static str,
    /// The GPU it ran on; none on the CPU.
    pub(crate) adapter: Option<String>,
    /// Features of that GPU in use, beyond what every one has.
    pub(crate) features: Vec<String>,
    /// Every setting with its value.
    pub(crate) settings: Value,
    /// Whether what was prepared still holds when only the camera moves.
    pub(crate) survives_camera: bool,
    /// Milliseconds of each stage, `prepare.*` and `shade.*`.
    pub(crate) stages_ms: BTreeMap<String, f64>,
    /// Wall time of preparation; on the GPU from recording to the end of its work.
    pub(crate) prepare_ms: f64,
    /// Wall time of shading, likewise.
    pub(crate) shade_ms: f64,
    /// Bytes held for this light.
    pub(crate) bytes: u64,
    /// What was skipped, and how many of it.
    pub(crate) skipped: BTreeMap<String, u64>,
    /// What the cost grows with, and how many of it.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub(crate) counted: BTreeMap<String, u64>,
    /// Triangles of the scene.
    pub(crate) triangles: usize,
    /// Pixels a row.
    pub(crate) width: u32,
    /// Rows.
    pub(crate) height: u32,
}

/// What a [`RunReport`] is about, beside the view.
pub(crate) struct Subject {
    pub(crate) technique: String,
    pub(crate) variant: String,
    pub(crate) settings: Value,
    pub(crate) survives_camera: bool,
}

impl RunReport {
    /// A run, on the GPU if its report says so.
    pub(crate) fn new(view: &View, subject: Subject, prepare_ms: f64, shade_ms: f64, report: Report) -> Self {
        let side = if report.gpu.is_some() { Side::Gpu } else { Side::Cpu };
        let (adapter, features) = report.gpu.map(|gpu| (gpu.adapter, gpu.features)).unzip();
        Self {
            scene: view.setup.name.clone(),
            light: LightReport::new(view.light_index, view.light()),
            technique: subject.technique,
            variant: subject.variant,
            backend: side.name(),
            adapter,
            features: features.unwrap_or_default(),
            settings: subject.settings,
            survives_camera: subject.survives_camera,
            stages_ms: report.stages_ms,
            prepare_ms,
            shade_ms,
            bytes: report.bytes,
            skipped: report.skipped,
            counted: report.counted,
            triangles: view.setup.scene.triangles().len(),
            width: view.setup.camera.width,
            height: view.setup.camera.height,
        }
    }
}
