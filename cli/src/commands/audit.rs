//! `gnomon audit`: what skipping saves, and that it changes no image. Rows are printed as they come: all of them take long.

use scene_core::VisibilityImage;
use scene_core::raster::render_gbuffer;
use scene_core::technique::{ShadowTechnique, TechniqueError};
use serde::Serialize;

use crate::args::{AuditArgs, SceneArgs};
use crate::backend::{self, Side};
use crate::bench::record::median;
use crate::compare::skipped;
use crate::compare::table::milliseconds;
use crate::console::Console;
use crate::error::{CliError, count_of};
use crate::measure::{Repeated, Repeats, Stand};
use crate::scene_source;
use crate::techniques::{label, named, variant_of, variants, with_seed};

/// Milliseconds after which a cell is not repeated.
const BUDGET_MS: f64 = 2000.0;

/// The setting that switches skipping.
const SKIP: &str = "skip";

/// A technique made twice: with skipping, and without.
struct Pair {
    label: String,
    on: Box<dyn ShadowTechnique>,
    off: Box<dyn ShadowTechnique>,
}

/// One technique on one scene.
#[derive(Debug, Serialize)]
struct Cell {
    scene: String,
    technique: String,
    backend: &'static str,
    /// Prepare and shade, median, with skipping.
    on_ms: f64,
    /// The same without.
    off_ms: f64,
    /// Pixels whose V differs in any bit.
    differing_pixels: usize,
    /// What was left out, in words.
    left_out: String,
}

#[derive(Debug, Serialize)]
struct AuditReport {
    cells: Vec<Cell>,
    /// Cells whose image skipping changed.
    changed: usize,
}

pub(crate) fn run(args: &AuditArgs, console: &Console) -> Result<(), CliError> {
    let pairs = pairs(&args.techniques, args.variants, args.seed)?;
    let gpu = backend::open(&args.backend)?;
    let names = scene_source::or_built_in(&args.scenes);
    let columns = Columns::new(&names, &pairs);
    let bar = console.progress("audit");
    let steps = (names.len() * pairs.len()) as f32;
    let mut cells: Vec<Cell> = Vec::new();
    for (number, name) in names.iter().enumerate() {
        let scene = SceneArgs {
            scene: name.clone(),
            size: Some(args.size),
            light: args.light,
            time: None,
            seed: args.seed,
        };
        let view = scene_source::view(&scene, console)?;
        let gbuffer = render_gbuffer(&view.setup.scene, &view.setup.camera);
        let mut stand = Stand::new(&view, &gbuffer, gpu.as_ref());
        for (done, pair) in pairs.iter().enumerate() {
            let sides = backend::sides(pair.on.as_ref(), &args.backend, gpu.is_some());
            for side in sides.into_iter().filter_map(|(_, side)| side) {
                bar.at(format!("{} ({}) on {name}", pair.label, side.name()));
                if let Some(cell) = cell(&mut stand, pair, side, args.runs, name)? {
                    if cells.is_empty() {
                        bar.above(|| console.row(&columns.headings()))?;
                    }
                    bar.above(|| console.row(&columns.row(&cell)))?;
                    cells.push(cell);
                }
            }
            bar.set((number * pairs.len() + done + 1) as f32 / steps);
        }
    }
    drop(bar);
    let changed = cells.iter().filter(|cell| cell.differing_pixels > 0).count();
    console.result(&AuditReport { cells, changed }, "")?;
    if changed > 0 {
        return Err(CliError::CheckFailed(count_of(changed, "image") + " changed by skipping"));
    }
    Ok(())
}

/// Techniques in words of the command line that have something to skip.
fn pairs(words: &[String], every_variant: bool, seed: u64) -> Result<Vec<Pair>, CliError> {
    let mut pairs = Vec::new();
    for factory in named(words)? {
        if !factory.settings().iter().any(|setting| setting.name == SKIP) {
            continue;
        }
        let chosen: Vec<Option<&str>> = match variants(factory) {
            names if every_variant && !names.is_empty() => names.iter().copied().map(Some).collect(),
            _ => vec![None],
        };
        for variant in chosen {
            let make = |skip: bool| {
                let mut overrides = vec![(SKIP.to_owned(), skip.to_string())];
                overrides.extend(variant.map(|variant| ("variant".to_owned(), variant.to_owned())));
                factory.create(None, &with_seed(factory, &overrides, seed))
            };
            let (on, off) = (make(true)?, make(false)?);
            let label = label(factory.name(), None, &variant_of(on.as_ref()));
            pairs.push(Pair { label, on, off });
        }
    }
    Ok(pairs)
}

/// Runs a pair; none where the technique does not take the scene. Runs alternate, so that a busy machine slows both.
fn cell(
    stand: &mut Stand<'_>,
    pair: &Pair,
    side: Side,
    runs: u16,
    scene: &str,
) -> Result<Option<Cell>, CliError> {
    // The first run pays for cold caches.
    let once = Repeats { runs: 2, budget_ms: BUDGET_MS };
    let (mut on_ms, mut off_ms) = (Vec::new(), Vec::new());
    let mut last = None;
    for _ in 0..runs {
        let on = match stand.repeat(pair.on.as_ref(), side, once) {
            Err(CliError::Technique(TechniqueError::Unsupported { .. })) => return Ok(None),
            run => run?,
        };
        let off = stand.repeat(pair.off.as_ref(), side, once)?;
        on_ms.push(whole_ms(&on));
        off_ms.push(whole_ms(&off));
        let is_slow = on_ms.iter().chain(&off_ms).sum::<f64>() > BUDGET_MS;
        last = Some((on, off));
        if is_slow {
            break;
        }
    }
    Ok(last.map(|(on, off)| Cell {
        scene: scene.to_owned(),
        technique: pair.label.clone(),
        backend: side.name(),
        on_ms: median(on_ms),
        off_ms: median(off_ms),
        differing_pixels: differing(&on.fastest.visibility, &off.fastest.visibility),
        left_out: skipped::in_words(&on.fastest.report).unwrap_or_else(|| "nothing".to_owned()),
    }))
}

/// Milliseconds of the last run.
fn whole_ms(runs: &Repeated) -> f64 {
    runs.times_ms.last().map_or(f64::NAN, |(prepare, shade)| prepare + shade)
}

/// Pixels whose bits differ; two NaN are alike.
fn differing(a: &VisibilityImage, b: &VisibilityImage) -> usize {
    let differ = |(a, b): (&f32, &f32)| a.to_bits() != b.to_bits() && !(a.is_nan() && b.is_nan());
    a.values.iter().zip(&b.values).filter(|&pair| differ(pair)).count()
}

/// Widths of the columns whose words are of any length; known before the first row is.
struct Columns {
    scene: usize,
    technique: usize,
}

impl Columns {
    fn new(scenes: &[String], pairs: &[Pair]) -> Self {
        let widest = |words: &mut dyn Iterator<Item = &str>| words.map(|word| word.chars().count()).max();
        let scene = widest(&mut scenes.iter().map(String::as_str).chain(["scene"])).unwrap_or(0);
        let labels = pairs.iter().map(|pair| pair.label.as_str());
        let technique = widest(&mut labels.chain(["technique"])).unwrap_or(0);
        Self { scene, technique }
    }

    fn headings(&self) -> String {
        self.line(["scene", "technique", "backend", "on ms", "off ms", "off / on", "differ", "left out"])
    }

    fn row(&self, cell: &Cell) -> String {
        self.line([
            &cell.scene,
            &cell.technique,
            cell.backend,
            &milliseconds(cell.on_ms),
            &milliseconds(cell.off_ms),
            &format!("{:.2}", cell.off_ms / cell.on_ms),
            &cell.differing_pixels.to_string(),
            &cell.left_out,
        ])
    }

    fn line(&self, [scene, technique, backend, on, off, ratio, differ, left_out]: [&str; 8]) -> String {
        let Self { scene: scene_width, technique: technique_width } = self;
        format!(
            "{scene:<scene_width$}  {technique:<technique_width$}  {backend:<7}  {on:>7}  {off:>7}  {ratio:>8}  {differ:>6}  {left_out}"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_differ_by_bits() {
        let image = |values: [f32; 3]| VisibilityImage { width: 3, height: 1, values: values.to_vec() };
        assert_eq!(differing(&image([0.0, f32::NAN, 0.5]), &image([0.0, f32::NAN, 0.5])), 0);
        assert_eq!(differing(&image([0.0, f32::NAN, 0.5]), &image([1e-9, 0.0, 0.5])), 2);
    }

    #[test]
    fn columns_are_aligned_before_all_rows_are_known() {
        let pairs = pairs(&["psm".to_owned()], false, 0).unwrap();
        let columns = Columns::new(&["a scene".to_owned()], &pairs);
        let cell = Cell {
            scene: "a scene".to_owned(),
            technique: pairs[0].label.clone(),
            backend: "cpu",
            on_ms: 1.0,
            off_ms: 2.5,
            differing_pixels: 0,
            left_out: "nothing".to_owned(),
        };
        let (headings, row) = (columns.headings(), columns.row(&cell));
        assert_eq!(headings.find("left out"), row.find("nothing"));
        assert!(row.contains("    1.00     2.50      2.50       0"), "{row}");
    }

    #[test]
    fn every_technique_can_be_told_not_to_skip() {
        let pairs = pairs(&[], true, 0).unwrap();
        for factory in crate::techniques::all() {
            assert!(pairs.iter().any(|pair| pair.on.name() == factory.name()), "{}", factory.name());
        }
        for pair in &pairs {
            assert_ne!(pair.on.settings(), pair.off.settings(), "{}", pair.label);
        }
    }
}
