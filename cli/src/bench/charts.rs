//! Charts of records, as SVG and PNG: time against error with its front, memory against error, and cost curves.

use std::collections::BTreeMap;

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::{FontStyle, register_font};

use super::front::{Error, Place, Time, pareto};
use super::record::Record;
use super::station::Axis;
use crate::error::CliError;
use crate::picture;

const SIZE: (u32, u32) = (1180, 600);
/// Where the key begins, right of the chart.
const KEY: u32 = 930;
/// Colours that are told apart with any kind of sight (Okabe and Ito's, darker where they are pale on white).
const COLOURS: [RGBColor; 8] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 138, 100),
    RGBColor(180, 90, 140),
    RGBColor(200, 140, 0),
    RGBColor(70, 150, 200),
    RGBColor(110, 80, 50),
    RGBColor(60, 60, 140),
];
const RAYS_PLAIN: RGBColor = RGBColor(150, 150, 150);
const RAYS_SKIPPING: RGBColor = RGBColor(60, 60, 60);

/// A finished chart.
pub(crate) struct Chart {
    /// Without extension.
    pub(crate) file: String,
    pub(crate) svg: String,
    pub(crate) png: Vec<u8>,
}

/// Points of one colour.
struct Series {
    name: String,
    points: Vec<(f64, f64)>,
    colour: RGBColor,
    /// Joined by a line.
    is_curve: bool,
}

/// What a chart shows; both axes are logarithmic.
struct Drawing {
    title: String,
    x: String,
    y: String,
    series: Vec<Series>,
    /// Drawn as steps, its points ringed and named.
    front: Vec<(f64, f64, String)>,
}

/// Time against error of one scene, or of means over scenes.
pub(crate) fn time_against_error(
    file: String,
    title: String,
    places: &[Place],
    time: Time,
    error: Error,
) -> Result<Option<Chart>, CliError> {
    let mut series = rays(places);
    for (technique, points) in by_technique(places) {
        let colour = colour_of(technique);
        series.push(Series { name: technique.to_owned(), points, colour, is_curve: false });
    }
    let front = pareto(places).iter().map(|p| (p.ms, p.error, p.name.clone())).collect();
    let x = match time {
        Time::Whole => "milliseconds, prepare and shade",
        Time::Frame => "milliseconds a frame while only the camera moves",
    };
    Drawing { title, x: x.to_owned(), y: error.name().to_owned(), series, front }.chart(file)
}

/// Memory against error over one scene.
pub(crate) fn memory_against_error(
    file: String,
    title: String,
    records: &[&Record],
) -> Result<Option<Chart>, CliError> {
    let mut by_technique: BTreeMap<&str, Vec<(f64, f64)>> = BTreeMap::new();
    for record in records {
        if let Some(measured) = record.measured() {
            let point = (measured.bytes.max(1) as f64 / 1_048_576.0, measured.rmse.max(record.truth_noise));
            by_technique.entry(&record.technique).or_default().push(point);
        }
    }
    let series = by_technique
        .into_iter()
        .map(|(name, points)| Series {
            name: name.to_owned(),
            points,
            colour: colour_of(name),
            is_curve: false,
        })
        .collect();
    let (x, y) = ("MiB held for the light".to_owned(), "rmse".to_owned());
    Drawing { title, x, y, series, front: Vec::new() }.chart(file)
}

/// Milliseconds of every contender over one axis.
pub(crate) fn cost_curve(axis: Axis, records: &[Record]) -> Result<Option<Chart>, CliError> {
    let mut curves: BTreeMap<String, Vec<(f64, f64)>> = BTreeMap::new();
    let mut scene = None;
    for record in records {
        if let (Some(point), Some(measured)) = (record.point.filter(|p| p.axis == axis), record.measured()) {
            let name = record.name();
            let x = if axis == Axis::Triangles { record.triangles as f64 } else { point.value };
            curves.entry(name).or_default().push((x, measured.whole_ms()));
            scene = Some(record.scene.split(':').next().unwrap_or_default().to_owned());
        }
    }
    let Some(scene) = scene else { return Ok(None) };
    let series = curves
        .into_iter()
        .map(|(name, mut points)| {
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            let technique = name.split([' ', '@']).next().unwrap_or_default();
            let colour = if name == "rays 64" { RAYS_PLAIN } else { colour_of(technique) };
            Series { name, points, colour, is_curve: true }
        })
        .collect();
    let title = format!("{scene}: cost of the defaults");
    let (x, y) = (axis.label().to_owned(), "milliseconds, prepare and shade".to_owned());
    let file = format!("cost-{}", format!("{axis:?}").to_lowercase());
    Drawing { title, x, y, series, front: Vec::new() }.chart(file)
}

/// A technique has its colour in every chart.
fn colour_of(technique: &str) -> RGBColor {
    let place = crate::techniques::all().iter().position(|factory| factory.name() == technique);
    place.map_or(RAYS_SKIPPING, |place| COLOURS[place % COLOURS.len()])
}

fn rays(places: &[Place]) -> Vec<Series> {
    let of = |skipping: bool| {
        let mut points: Vec<_> =
            places.iter().filter(|place| place.is_rays_with(skipping)).map(|p| (p.ms, p.error)).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points
    };
    let series = |name: &str, skipping, colour| Series {
        name: name.to_owned(),
        points: of(skipping),
        colour,
        is_curve: true,
    };
    vec![
        series("ray tracing, 1 to 256 samples", false, RAYS_PLAIN),
        series("ray tracing with skipping", true, RAYS_SKIPPING),
    ]
}

fn by_technique(places: &[Place]) -> BTreeMap<&str, Vec<(f64, f64)>> {
    let mut techniques: BTreeMap<&str, Vec<(f64, f64)>> = BTreeMap::new();
    for place in places.iter().filter(|place| !place.is_rays()) {
        techniques.entry(&place.technique).or_default().push((place.ms, place.error));
    }
    techniques
}

impl Drawing {
    /// Draws it twice; none if it has no points.
    fn chart(self, file: String) -> Result<Option<Chart>, CliError> {
        let Some(ranges) = self.ranges() else { return Ok(None) };
        // Kept by the library for the whole process; giving the same bytes again changes nothing.
        register_font("sans-serif", FontStyle::Normal, epaint_default_fonts::UBUNTU_LIGHT)
            .map_err(|_| CliError::Chart("its font cannot be read".to_owned()))?;
        let mut svg = String::new();
        self.draw(&SVGBackend::with_string(&mut svg, SIZE).into_drawing_area(), ranges)?;
        let mut pixels = vec![0; SIZE.0 as usize * SIZE.1 as usize * 3];
        self.draw(&BitMapBackend::with_buffer(&mut pixels, SIZE).into_drawing_area(), ranges)?;
        let image = image::RgbImage::from_raw(SIZE.0, SIZE.1, pixels)
            .ok_or_else(|| CliError::Chart("its pixels do not fill it".to_owned()))?;
        Ok(Some(Chart { file, svg, png: picture::small_png(&image)? }))
    }

    /// Of both axes, with some room. Nothing that is not finite and positive can stand on them.
    fn ranges(&self) -> Option<[(f64, f64); 2]> {
        let points = || {
            let all = self.series.iter().flat_map(|series| series.points.iter());
            all.filter(|(x, y)| [*x, *y].iter().all(|v| v.is_finite() && *v > 0.0))
        };
        points().next()?;
        let range = |values: &mut dyn Iterator<Item = f64>| {
            let (low, high) = values.fold((f64::MAX, 0.0_f64), |(l, h), v| (l.min(v), h.max(v)));
            (low / 1.4, high * 1.4)
        };
        Some([range(&mut points().map(|p| p.0)), range(&mut points().map(|p| p.1))])
    }

    fn draw<B: DrawingBackend>(
        &self,
        area: &DrawingArea<B, Shift>,
        [(x0, x1), (y0, y1)]: [(f64, f64); 2],
    ) -> Result<(), CliError> {
        let fault = |error: &dyn std::fmt::Display| CliError::Chart(error.to_string());
        area.fill(&WHITE).map_err(|e| fault(&e))?;
        let (left, key) = area.split_horizontally(KEY);
        let mut chart = ChartBuilder::on(&left)
            .margin(14)
            .caption(&self.title, ("sans-serif", 22))
            .x_label_area_size(46)
            .y_label_area_size(72)
            .build_cartesian_2d((x0..x1).log_scale(), (y0..y1).log_scale())
            .map_err(|e| fault(&e))?;
        chart
            .configure_mesh()
            .x_desc(&self.x)
            .y_desc(&self.y)
            .label_style(("sans-serif", 15))
            .axis_desc_style(("sans-serif", 17))
            .light_line_style(WHITE)
            .bold_line_style(RGBColor(225, 225, 225))
            .x_label_formatter(&|v| number(*v))
            .y_label_formatter(&|v| number(*v))
            .draw()
            .map_err(|e| fault(&e))?;
        for series in self.series.iter().filter(|series| !series.points.is_empty()) {
            let colour = series.colour;
            if series.is_curve {
                let line = LineSeries::new(series.points.iter().copied(), colour.stroke_width(2));
                chart.draw_series(line).map_err(|e| fault(&e))?;
            }
            let dots = series.points.iter().map(|&point| Circle::new(point, 4, colour.filled()));
            chart.draw_series(dots).map_err(|e| fault(&e))?;
        }
        let steps: Vec<(f64, f64)> = self.steps(x1);
        chart.draw_series(LineSeries::new(steps, BLACK.mix(0.35).stroke_width(1))).map_err(|e| fault(&e))?;
        let rings = self.front.iter().map(|(x, y, _)| Circle::new((*x, *y), 7, BLACK.stroke_width(1)));
        chart.draw_series(rings).map_err(|e| fault(&e))?;
        let style = TextStyle::from(("sans-serif", 14).into_font());
        // Names keep clear of rings, too.
        let ring = |(x, y): (i32, i32)| [x - 7, y - 7, x + 7, y + 7];
        let mut taken: Vec<_> =
            self.front.iter().map(|(x, y, _)| ring(chart.backend_coord(&(*x, *y)))).collect();
        for (x, y, name) in self.front.iter().filter(|(_, _, name)| !name.starts_with("rays")) {
            let at = chart.backend_coord(&(*x, *y));
            let size = left.estimate_text_size(name, &style).map_err(|e| fault(&e))?;
            if let Some(offset) = free_place(at, size, &mut taken) {
                let text = EmptyElement::at((*x, *y)) + Text::new(name.clone(), offset, style.clone());
                chart.draw_series([text]).map_err(|e| fault(&e))?;
            }
        }
        let named = self.series.iter().filter(|series| !series.points.is_empty());
        for (row, series) in (0..).zip(named) {
            let y = 60 + 24 * row;
            key.draw(&Circle::new((12, y + 8), 4, series.colour.filled())).map_err(|e| fault(&e))?;
            key.draw(&Text::new(series.name.clone(), (24, y), ("sans-serif", 15))).map_err(|e| fault(&e))?;
        }
        drop(chart);
        area.present().map_err(|e| fault(&e))
    }

    /// The front as a staircase up to the right end.
    fn steps(&self, x1: f64) -> Vec<(f64, f64)> {
        let mut steps = Vec::new();
        for (i, (x, y, _)) in self.front.iter().enumerate() {
            steps.push((*x, *y));
            steps.push((self.front.get(i + 1).map_or(x1, |next| next.0), *y));
        }
        steps
    }
}

/// Offset of a name of this size from its point, in pixels: above or below it, where it covers nothing that is `taken`. A name without a place is
/// left out; the table has it.
fn free_place(at: (i32, i32), size: (u32, u32), taken: &mut Vec<[i32; 4]>) -> Option<(i32, i32)> {
    let [width, height] = [size.0, size.1].map(|side| i32::try_from(side).unwrap_or(i32::MAX / 4));
    [(9, -16), (9, 4)].into_iter().find(|(dx, dy)| {
        let [left, top] = [at.0 + dx, at.1 + dy];
        let own = [left, top, left + width, top + height];
        let is_free = taken.iter().all(|other| {
            own[2] <= other[0] || other[2] <= own[0] || own[3] <= other[1] || other[3] <= own[1]
        });
        if is_free {
            taken.push(own);
        }
        is_free
    })
}

/// 1000000 → "1000000", 0.0123 → "0.0123": no more digits than needed.
fn number(value: f64) -> String {
    if value >= 1e5 { format!("{value:.0e}") } else { format!("{}", (value * 1e6).round() / 1e6) }
}

#[cfg(test)]
mod tests {
    use super::super::front::places;
    use super::super::record::tests::record;
    use super::*;

    #[test]
    fn names_do_not_cover_each_other() {
        let mut taken = Vec::new();
        assert_eq!(free_place((100, 100), (50, 14), &mut taken), Some((9, -16)));
        // Too near above, free below; then neither; then farther off.
        assert_eq!(free_place((120, 102), (50, 14), &mut taken), Some((9, 4)));
        assert_eq!(free_place((110, 101), (50, 14), &mut taken), None);
        assert_eq!(free_place((200, 101), (50, 14), &mut taken), Some((9, -16)));
        assert_eq!(taken.len(), 3);
    }

    #[test]
    fn a_chart_names_its_front_and_nothing_makes_none() {
        let records = [
            record("ball", "rays 4", 2.0, 0.1),
            record("ball", "rays 16", 8.0, 0.02),
            record("ball", "shadow-map pcss", 1.0, 0.05),
        ];
        let places = places(&records, Time::Whole, Error::Rmse);
        let chart = |places: &[Place]| {
            time_against_error("a".into(), "ball".into(), places, Time::Whole, Error::Rmse).unwrap()
        };
        let drawn = chart(&places).unwrap();
        assert!(drawn.svg.contains("shadow-map pcss") && drawn.svg.contains("rmse"));
        assert!(drawn.png.starts_with(b"\x89PNG"));
        assert!(chart(&[]).is_none());
        assert!(cost_curve(Axis::Image, &records).unwrap().is_none());
    }
}
