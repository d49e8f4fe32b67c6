//! Figure 7 of the paper, a to d: construction time against maps, pixels and resolution, and memory against maps before
//! and after compression. `cargo run --release -p gnomon-pdsm --example figure_7 [OUT.png [SCENE]]`; SCENE may be a built-in
//! scene or a file, a knot of 200,000 triangles without one. The numbers go to stdout.

use std::path::Path;

use gnomon_pdsm::{Pdsm, PdsmParams};
use plotters::prelude::*;
use plotters::style::{FontStyle, register_font};
use scene_core::{SceneSetup, io, scenes};

type Failure = Box<dyn std::error::Error>;

const SIZE: (u32, u32) = (1120, 840);
const COLOURS: [RGBColor; 5] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 138, 100),
    RGBColor(180, 90, 140),
    RGBColor(60, 60, 60),
];

/// One curve: its name and points.
type Curve = (String, Vec<(f64, f64)>);

struct Measured {
    seconds: f64,
    /// Of the functions, and what they would take with every event kept, at 8 bytes each.
    mib: [f64; 2],
}

fn measure(setup: &SceneSetup, views: u32, pdsm_size: u32, map_size: u32) -> Measured {
    let params = PdsmParams { views, pdsm_size, map_size, max_error: 0.02, ..Default::default() };
    let build = || Pdsm::new(params).prepare(&setup.scene, &setup.lights[0]);
    // The first run pays for fresh memory.
    let runs: Vec<f64> = (0..2).map(|_| build().1.total_ms("prepare.") * 1e-3).collect();
    let (pdsm, report) = build();
    let seconds = runs.iter().copied().fold(report.total_ms("prepare.") * 1e-3, f64::min);
    let events: u64 = pdsm.windows().iter().map(|window| window.functions.statistics().events).sum();
    let mib = 1.0 / f64::from(1 << 20);
    let index = f64::from(pdsm_size) * f64::from(pdsm_size) * 4.0 * pdsm.windows().len() as f64;
    Measured { seconds, mib: [report.bytes as f64 * mib, (index + events as f64 * 8.0) * mib] }
}

fn print(title: &str, curves: &[Curve]) {
    println!("{title}");
    for (name, points) in curves {
        let points: Vec<String> = points.iter().map(|(x, y)| format!("{x}: {y:.3}")).collect();
        println!("  {name}: {}", points.join(", "));
    }
}

fn panel<B: DrawingBackend>(
    area: &DrawingArea<B, plotters::coord::Shift>,
    [title, x, y]: [&str; 3],
    curves: &[Curve],
) -> Result<(), Failure>
where
    B::ErrorType: 'static,
{
    let points = || curves.iter().flat_map(|(_, points)| points);
    let most = |of: fn(&(f64, f64)) -> f64| points().map(of).fold(0.0, f64::max) * 1.05;
    let mut chart = ChartBuilder::on(area)
        .margin(12)
        .caption(title, ("sans-serif", 20))
        .x_label_area_size(42)
        .y_label_area_size(62)
        .build_cartesian_2d(0.0..most(|p| p.0), 0.0..most(|p| p.1))?;
    chart
        .configure_mesh()
        .x_desc(x)
        .y_desc(y)
        .light_line_style(WHITE)
        .bold_line_style(RGBColor(225, 225, 225))
        .label_style(("sans-serif", 14))
        .axis_desc_style(("sans-serif", 15))
        .draw()?;
    for ((name, points), colour) in curves.iter().zip(COLOURS) {
        chart
            .draw_series(LineSeries::new(points.iter().copied(), colour.stroke_width(2)))?
            .label(name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], colour.stroke_width(2)));
        chart.draw_series(points.iter().map(|&point| Circle::new(point, 3, colour.filled())))?;
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::Coordinate(8, 136))
        .background_style(WHITE.mix(0.8))
        .label_font(("sans-serif", 14))
        .draw()?;
    Ok(())
}

fn main() -> Result<(), Failure> {
    let mut arguments = std::env::args().skip(1);
    let out = arguments.next().unwrap_or_else(|| "figure_7.png".to_owned());
    let scene = arguments.next().unwrap_or_else(|| "knot:sides=79".to_owned());
    let setup = if Path::new(&scene).exists() {
        io::load_setup(Path::new(&scene))?
    } else {
        scenes::build(&scene, 0.0)?
    };
    let counts = [4, 16, 36, 64, 144, 256];
    let by_count: Vec<(f64, Measured)> =
        counts.iter().map(|&k| (f64::from(k), measure(&setup, k, 512, 512))).collect();
    let seconds = |measured: &[(f64, Measured)]| measured.iter().map(|(x, m)| (*x, m.seconds)).collect();
    let maps: Vec<Curve> = vec![("PDSM and maps of 512²".to_owned(), seconds(&by_count))];
    let pixels: Vec<Curve> = [4, 16, 36, 64, 256]
        .iter()
        .map(|&k| {
            // Maps are as fine as the largest PDSM throughout.
            let sizes = [128, 256, 512];
            let points = sizes.iter().map(|&n| (f64::from(n * n) * 1e-3, measure(&setup, k, n, 512).seconds));
            (format!("{k} maps of 512²"), points.collect())
        })
        .collect();
    let resolution: Vec<Curve> = [16, 64]
        .iter()
        .map(|&k| {
            let sizes = [128, 256, 512, 1024, 2048];
            (
                format!("{k} maps, PDSM of 128²"),
                sizes.iter().map(|&m| (f64::from(m), measure(&setup, k, 128, m).seconds)).collect(),
            )
        })
        .collect();
    let memory: Vec<Curve> = ["compressed, ε = .02", "every event"]
        .iter()
        .enumerate()
        .map(|(of, name)| ((*name).to_owned(), by_count.iter().map(|(k, m)| (*k, m.mib[of])).collect()))
        .collect();
    let panels = [
        (["(a) construction", "maps", "s"], maps),
        (["(b) construction", "pixels of the PDSM, thousands", "s"], pixels),
        (["(c) construction", "texels a side of each map", "s"], resolution),
        (["(d) memory", "maps", "MiB"], memory),
    ];
    register_font("sans-serif", FontStyle::Normal, epaint_default_fonts::UBUNTU_LIGHT)
        .map_err(|_| "the font cannot be read")?;
    let mut pixels = vec![0; SIZE.0 as usize * SIZE.1 as usize * 3];
    {
        let root = BitMapBackend::with_buffer(&mut pixels, SIZE).into_drawing_area();
        root.fill(&WHITE)?;
        for (area, (labels, curves)) in root.split_evenly((2, 2)).iter().zip(&panels) {
            print(labels[0], curves);
            panel(area, *labels, curves)?;
        }
        root.present()?;
    }
    io::write::color_png(Path::new(&out), pixels.as_chunks().0, SIZE.0, SIZE.1)?;
    Ok(())
}
