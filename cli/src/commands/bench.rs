//! `gnomon bench`: run time against error, over everything there is.

use std::time::Instant;

use scene_core::bvh::Bvh;
use scene_core::io::write;
use scene_core::metrics;
use scene_core::raster::render_gbuffer;
use scene_core::reference::{ReferenceSettings, reference};
use scene_core::technique::TechniqueError;
use scene_core::{GBuffer, Report};
use serde_json::json;

use crate::args::{BenchArgs, TruthArgs};
use crate::backend::{self, Side};
use crate::bench::contender::{self, Contender, Kind};
use crate::bench::front::RAYS;
use crate::bench::machine::Machine;
use crate::bench::record::{self, Measured, Outcome, Record, Records};
use crate::bench::station::{self, Station};
use crate::bench::{page, pictures, table, truth_cache};
use crate::console::Console;
use crate::error::{CliError, count_of};
use crate::ground_truth::GroundTruth;
use crate::measure::{Repeats, Run, Stand, milliseconds_since, repeat};
use crate::output::OutputFolder;
use crate::picture::shading::Shading;
use crate::recommend::data::Data;
use crate::recommend::preview::Preview;
use crate::report::{RunReport, Subject};
use crate::scene_source::{self, View};

/// Milliseconds after which a cell is not repeated.
const BUDGET_MS: f64 = 2000.0;

/// What takes longer to prepare is not tried on a small picture, and so not recommended.
const LONGEST_TRIAL_MS: f64 = 5000.0;

pub(crate) fn run(args: &BenchArgs, console: &Console) -> Result<(), CliError> {
    let out = OutputFolder::check(&args.out)?;
    let records = if args.merge.is_empty() {
        measure(args, console)?
    } else {
        let records = record::merge(&args.merge)?;
        std::fs::create_dir_all(&args.out)
            .map_err(|source| CliError::Write { path: args.out.clone(), source })?;
        record::write_all(&args.out, &records)?;
        records
    };
    let pictures = args.merge.first().unwrap_or(&args.out).join("pictures");
    let page = {
        let _working = console.working("drawing");
        page::page(&records, &pictures)?
    };
    let csv = table::csv(&records)?;
    let measurements = Data::from_records(&records).csv()?;
    out.write(|to| {
        write::bytes(&to.join("results.csv"), &csv)?;
        write::bytes(&to.join("recommend.csv"), &measurements)?;
        write::json(&to.join("results.json"), &records)?;
        for chart in &page.charts {
            write::bytes(&to.join(format!("{}.svg", chart.file)), chart.svg.as_bytes())?;
            write::bytes(&to.join(format!("{}.png", chart.file)), &chart.png)?;
        }
        write::bytes(&to.join("index.html"), &page.html)
    })?;
    console.note(&format!("wrote {}", out.path().join("index.html").display()));
    console.result(&records, &table::text(&records))
}

/// A contender on a side of a station.
struct Cell {
    key: String,
    contender: Contender,
    side: Side,
}

/// Measures what is not measured yet.
fn measure(args: &BenchArgs, console: &Console) -> Result<Vec<Record>, CliError> {
    let gpu = backend::open(&args.backend)?;
    let contenders = contender::all(&args.techniques, args.seed)?;
    let scenes = scene_source::or_built_in(&args.scenes);
    let machine = Machine::this();
    let mut records = Records::open(&args.out, args.fresh)?;
    let mut plan: Vec<(Station, Vec<Cell>)> = Vec::new();
    let mut number = 0;
    for station in station::all(&scenes, args.size, &args.sweep) {
        let mut cells = cells(&station, &contenders, args, gpu.is_some())?;
        cells.retain(|cell| {
            number += 1;
            args.shard.has(number - 1) && !records.holds(&cell.key, &machine, args.seed, args.samples)
        });
        plan.push((station, cells));
    }
    let total: usize = plan.iter().map(|(_, cells)| cells.len()).sum();
    console.note(&format!(
        "{} to measure (shard {}); {} may be interrupted and run again: what is finished is kept",
        count_of(total, "cell"),
        args.shard,
        args.out.display()
    ));
    let bar = console.progress("measuring");
    let mut done = 0;
    for (station, cells) in plan.into_iter().filter(|(_, cells)| !cells.is_empty()) {
        let view = station.view(args.light, args.seed, console)?;
        let site = Site::new(&station, &view, args, console)?;
        let mut stand = Stand::new(&view, &site.gbuffer, gpu.as_ref());
        for cell in cells {
            let record = site.record(&mut stand, &cell, args, &machine)?;
            records.add(record)?;
            done += 1;
            bar.set(done as f32 / total as f32);
        }
    }
    Ok(records.into_all())
}

/// The cells of a station: all contenders on a scene as it is, the defaults on a cost curve.
fn cells(
    station: &Station,
    contenders: &[Contender],
    args: &BenchArgs,
    has_gpu: bool,
) -> Result<Vec<Cell>, CliError> {
    let mut cells: Vec<Cell> = Vec::new();
    for contender in contenders {
        let is_wanted = match station.point {
            Some(_) => contender.is_default,
            None => contender.is_default || !args.defaults || is_rays(contender),
        };
        if !is_wanted {
            continue;
        }
        let contender = match station.map_size() {
            None => contender.clone(),
            Some(map_size) => match contender.with_map_size(map_size, args.seed)? {
                Some(contender) => contender,
                None => continue,
            },
        };
        let sides = match &contender.kind {
            // The one backend that rays have; measured where the GPU alone is asked for, too.
            Kind::Rays { .. } => vec![Side::Cpu],
            Kind::Technique(technique) => {
                let sides = backend::sides(technique.as_ref(), &args.backend, has_gpu);
                sides.into_iter().filter_map(|(_, side)| side).collect()
            }
        };
        for side in sides {
            let key = format!("{} {} {}", station.name(), contender.label, side.name());
            cells.push(Cell { key, contender: contender.clone(), side });
        }
    }
    Ok(cells)
}

fn is_rays(contender: &Contender) -> bool {
    matches!(contender.kind, Kind::Rays { .. })
}

/// Whether preparing takes so little that `recommend` may try it.
fn is_quick(outcome: &Outcome) -> bool {
    matches!(outcome, Outcome::Measured(measured) if measured.prepare_ms < LONGEST_TRIAL_MS)
}

/// A station with its ground truth.
struct Site<'a> {
    station: &'a Station,
    view: &'a View,
    gbuffer: GBuffer,
    truth: GroundTruth,
    shares: metrics::Shares,
    shading: Shading,
    /// None on cost curves.
    preview: Option<Preview>,
    pictures: std::path::PathBuf,
}

impl<'a> Site<'a> {
    fn new(
        station: &'a Station,
        view: &'a View,
        args: &BenchArgs,
        console: &Console,
    ) -> Result<Self, CliError> {
        let gbuffer = render_gbuffer(&view.setup.scene, &view.setup.camera);
        let truth_args = TruthArgs { samples: args.samples, exact: false, max_error: None };
        let folder = args.truth.clone().unwrap_or_else(|| args.out.join("truth"));
        let truth = truth_cache::truth(view, &gbuffer, &truth_args, args.seed, &folder, console)?;
        let shading = Shading::new(&gbuffer, &view.setup.camera, view.light());
        let pictures = args.out.join("pictures");
        if station.point.is_none() {
            let path = pictures::path(&pictures, &format!("{} truth", station.name()));
            pictures::write_truth(&path, &truth, &shading)?;
        }
        let preview = match station.point {
            None => Some(Preview::new(view.clone(), args.seed)?),
            Some(_) => None,
        };
        let shares = metrics::shares(&truth.visibility, &truth.valid)?;
        Ok(Self { station, view, gbuffer, truth, shares, shading, preview, pictures })
    }

    /// Measures a cell.
    fn record(
        &self,
        stand: &mut Stand<'_>,
        cell: &Cell,
        args: &BenchArgs,
        machine: &Machine,
    ) -> Result<Record, CliError> {
        let repeats = Repeats { runs: args.runs as usize + 1, budget_ms: BUDGET_MS };
        let repeated = match &cell.contender.kind {
            Kind::Technique(technique) => stand.repeat(technique.as_ref(), cell.side, repeats),
            &Kind::Rays { samples, skip } => repeat(repeats, || self.rays(samples, args.seed, skip)),
        };
        let (technique, variant) = match &cell.contender.kind {
            Kind::Technique(technique) => {
                (technique.name().to_owned(), crate::techniques::variant_of(technique.as_ref()))
            }
            Kind::Rays { samples, skip } => (RAYS.to_owned(), contender::rays_variant(*samples, *skip)),
        };
        let (outcome, settings, adapter) = match repeated {
            Ok(repeated) => {
                if self.station.point.is_none() && cell.contender.is_default {
                    let path = pictures::path(&self.pictures, &cell.key);
                    pictures::write_run(&path, &repeated.fastest, &self.truth, &self.shading)?;
                }
                let errors =
                    metrics::errors(&repeated.fastest.visibility, &self.truth.visibility, &self.truth.valid)?;
                let report = &repeated.fastest.report;
                let (settings, adapter) = (report.settings.clone(), report.adapter.clone());
                (Outcome::Measured(Measured::new(&repeated, &errors)), settings, adapter)
            }
            Err(CliError::Technique(TechniqueError::Unsupported { input, why, .. })) => {
                (Outcome::Refused(format!("it does not take {input}: {why}")), json!(null), None)
            }
            Err(error) => return Err(error),
        };
        let tried = match (&self.preview, &cell.contender.kind, cell.side) {
            (Some(preview), Kind::Technique(technique), Side::Cpu) if is_quick(&outcome) => {
                preview.try_out(technique.as_ref())?
            }
            _ => None,
        };
        let light = self.view.light();
        Ok(Record {
            key: cell.key.clone(),
            scene: self.station.scene.clone(),
            point: self.station.point,
            light: light.kind().to_owned(),
            extended: light.is_extended(),
            width: self.gbuffer.width,
            height: self.gbuffer.height,
            triangles: self.view.setup.scene.triangles().len(),
            lit: self.shares.lit,
            penumbra: self.shares.penumbra,
            umbra: self.shares.umbra,
            truth_samples: args.samples,
            truth_noise: self.truth.noise(),
            label: cell.contender.label.clone(),
            technique,
            variant,
            preset: cell.contender.preset.map(str::to_owned),
            is_default: cell.contender.is_default,
            backend: cell.side.name().to_owned(),
            adapter,
            settings,
            seed: args.seed,
            machine: machine.clone(),
            features: self.preview.as_ref().map(|preview| *preview.features()),
            tried,
            outcome,
        })
    }

    /// Ray tracing as a contender: the tree is its preparation. Its seed is not that of ground truth.
    fn rays(&self, samples: u32, seed: u64, skip: bool) -> Result<Run, CliError> {
        let (scene, light) = (&self.view.setup.scene, self.view.light());
        let mut report = Report::default();
        let start = Instant::now();
        let bvh = report.time("prepare.bvh", |_| Bvh::casters(scene));
        report.bytes = bvh.bytes() as u64;
        let prepare_ms = milliseconds_since(start);
        let start = Instant::now();
        let settings = ReferenceSettings { samples, seed: !seed, skip };
        let traced = report.time("shade.rays", |_| {
            reference(scene, &bvh, light, &self.gbuffer, &settings, &|_| std::ops::ControlFlow::Continue(()))
        })?;
        let shade_ms = milliseconds_since(start);
        report.skip("wholly lit pixels", traced.work.proved_lit);
        report.skip("wholly dark pixels", traced.work.proved_dark);
        let subject = Subject {
            technique: RAYS.to_owned(),
            variant: contender::rays_variant(samples, skip),
            settings: json!({ "samples": samples, "skip": skip }),
            survives_camera: true,
        };
        Ok(Run {
            visibility: traced.visibility,
            report: RunReport::new(self.view, subject, prepare_ms, shade_ms, report),
        })
    }
}
