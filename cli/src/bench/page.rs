//! `index.html`: charts, tables and pictures of a sweep in one file that needs no network.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::Path;

use super::charts::{self, Chart};
use super::front::{Error, Time, by_scene, pareto, places, rays_ms_at, soft_means, soft_scenes};
use super::pictures;
use super::record::{Outcome, Record};
use super::station::Axis;
use crate::compare::html::{data_uri, escape, fill};
use crate::compare::table::{error_text, milliseconds};
use crate::compare::{percent, thousands};
use crate::error::CliError;

/// The page and the charts in it.
pub(crate) struct Page {
    pub(crate) html: Vec<u8>,
    pub(crate) charts: Vec<Chart>,
}

/// Columns of the tables: heading, and what it means.
const COLUMNS: [(&str, &str); 11] = [
    ("contender", "technique, preset, variant and backend"),
    ("prepare ms", "what depends on scene and light"),
    ("±", "distance between the quartiles of prepare"),
    ("shade ms", "what fills the image"),
    ("±", "distance between the quartiles of shade"),
    ("frame ms", "while only the camera moves"),
    ("MiB", "held for this light"),
    ("rmse", "root mean square error"),
    ("p99", "99th percentile of |error|"),
    ("pen_rmse", "root mean square error in and around penumbrae"),
    ("rays / it", "time of ray tracing with skipping at the same rmse, over its own"),
];

/// Makes the page. `folder` holds the pictures.
pub(crate) fn page(records: &[Record], folder: &Path) -> Result<Page, CliError> {
    let mut charts = Vec::new();
    let overall = overall(records, &mut charts)?;
    let curves = curves(records, &mut charts)?;
    let mut scenes = String::new();
    for (scene, records) in by_scene(records) {
        scenes.push_str(&one_scene(&scene, &records, folder, &mut charts)?);
    }
    let machines: BTreeSet<String> = records.iter().map(|record| record.machine.to_string()).collect();
    let machines = escape(&machines.into_iter().collect::<Vec<_>>().join("; "));
    let css = fill(include_str!("../compare/page/page.css"), &[("stops", "")]);
    let values = [
        ("version", env!("CARGO_PKG_VERSION")),
        ("css", &css),
        ("sort", crate::compare::page::SORT),
        ("machines", &machines),
        ("overall", &overall),
        ("curves", &curves),
        ("scenes", &scenes),
    ];
    Ok(Page { html: fill(include_str!("page/bench.html"), &values).into_bytes(), charts })
}

/// Means over all scenes whose light throws penumbrae.
fn overall(records: &[Record], charts: &mut Vec<Chart>) -> Result<String, CliError> {
    let soft = soft_scenes(records);
    if soft.len() < 2 {
        return Ok(String::new());
    }
    let mut figures = String::new();
    let mut fronts = Vec::new();
    for (time, error, file) in [
        (Time::Whole, Error::Rmse, "soft-rmse"),
        (Time::Whole, Error::PenRmse, "soft-pen-rmse"),
        (Time::Frame, Error::Rmse, "soft-rmse-frame"),
        (Time::Frame, Error::PenRmse, "soft-pen-rmse-frame"),
    ] {
        let means = soft_means(&soft, time, error);
        let title = format!("{} scenes with penumbrae, geometric means", soft.len());
        let chart = charts::time_against_error(file.to_owned(), title, &means, time, error)?;
        push_chart(&mut figures, charts, chart);
        if time == Time::Whole && error == Error::Rmse {
            fronts = pareto(&means).into_iter().cloned().collect();
        }
    }
    let mut words = String::new();
    for place in &fronts {
        let _ = write!(
            words,
            "<li>{}: {} ms, rmse {}</li>",
            escape(&place.name),
            milliseconds(place.ms),
            error_text(place.error)
        );
    }
    Ok(format!(
        "<section><h2>Over all scenes with penumbrae</h2><div class=\"charts\">{figures}</div>\
         <p>On the front of the means:</p><ul>{words}</ul></section>"
    ))
}

/// Cost over triangles, pixels, texels and the light's size, as far as they were measured.
fn curves(records: &[Record], charts: &mut Vec<Chart>) -> Result<String, CliError> {
    let mut figures = String::new();
    for axis in [Axis::Triangles, Axis::Image, Axis::Map, Axis::Light] {
        let chart = charts::cost_curve(axis, records)?;
        push_chart(&mut figures, charts, chart);
    }
    if figures.is_empty() {
        return Ok(figures);
    }
    Ok(format!("<section><h2>What the cost grows with</h2><div class=\"charts\">{figures}</div></section>"))
}

fn one_scene(
    scene: &str,
    records: &[&Record],
    folder: &Path,
    charts: &mut Vec<Chart>,
) -> Result<String, CliError> {
    let slug: String = scene.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect();
    let mut figures = String::new();
    for (error, suffix) in [(Error::Rmse, "rmse"), (Error::PenRmse, "pen-rmse")] {
        let places = places(records.iter().copied(), Time::Whole, error);
        let file = format!("{slug}-{suffix}");
        let chart = charts::time_against_error(file, scene.to_owned(), &places, Time::Whole, error)?;
        push_chart(&mut figures, charts, chart);
    }
    let chart = charts::memory_against_error(format!("{slug}-memory"), scene.to_owned(), records)?;
    push_chart(&mut figures, charts, chart);
    let facts = records.first().map_or(String::new(), |record| {
        let shares = record.shares();
        format!(
            "{} triangles, {} light; {} lit, {} penumbra, {} umbra; ground truth {} samples a pixel, its own error {}",
            thousands(record.triangles),
            escape(&record.light),
            percent(shares.lit),
            percent(shares.penumbra),
            percent(shares.umbra),
            record.truth_samples,
            error_text(record.truth_noise),
        )
    });
    Ok(format!(
        "<section><h2>{}</h2><p>{facts}</p><div class=\"charts\">{figures}</div>\n{}\n\
         <details><summary>All figures</summary><div class=\"scroll\">{}</div>{}</details></section>\n",
        escape(scene),
        gallery(scene, records, folder),
        table(records),
        refused(records),
    ))
}

fn push_chart(figures: &mut String, charts: &mut Vec<Chart>, chart: Option<Chart>) {
    if let Some(chart) = chart {
        let _ = write!(figures, "<figure class=\"chart\">{}</figure>", chart.svg);
        charts.push(chart);
    }
}

fn table(records: &[&Record]) -> String {
    let all = places(records.iter().copied(), Time::Whole, Error::Rmse);
    let ahead: BTreeSet<&str> = pareto(&all).iter().map(|place| place.name.as_str()).collect();
    let mut html = String::from("<table><thead><tr>");
    for (name, title) in COLUMNS {
        let _ = write!(
            html,
            "<th scope=\"col\"><button type=\"button\" title=\"{title}\">{}</button></th>",
            escape(name)
        );
    }
    html.push_str("</tr></thead><tbody>\n");
    for record in records {
        let Some(measured) = record.measured() else { continue };
        let name = record.name();
        let rays = (record.technique != super::front::RAYS)
            .then(|| rays_ms_at(&all, measured.rmse.max(record.truth_noise), true))
            .flatten()
            .map(|ms| ms / measured.whole_ms());
        let cells = [
            (Some(measured.prepare_ms), milliseconds(measured.prepare_ms)),
            (Some(measured.prepare_spread_ms), milliseconds(measured.prepare_spread_ms)),
            (Some(measured.shade_ms), milliseconds(measured.shade_ms)),
            (Some(measured.shade_spread_ms), milliseconds(measured.shade_spread_ms)),
            (Some(measured.frame_ms()), milliseconds(measured.frame_ms())),
            (Some(measured.bytes as f64), format!("{:.1}", measured.bytes as f64 / 1_048_576.0)),
            (Some(measured.rmse), error_text(measured.rmse)),
            (Some(measured.p99), error_text(measured.p99)),
            (measured.pen_rmse, measured.pen_rmse.map_or("-".to_owned(), error_text)),
            (rays, rays.map_or("-".to_owned(), |ratio| format!("{ratio:.2}"))),
        ];
        let escaped = escape(&name);
        let mark =
            if ahead.contains(name.as_str()) { "<strong title=\"on the front\">◆</strong> " } else { "" };
        let _ = write!(html, "<tr><th scope=\"row\" data-value=\"{escaped}\">{mark}{escaped}</th>");
        for (value, text) in cells {
            let value = value.map_or(String::new(), |value| value.to_string());
            let _ = write!(html, "<td data-value=\"{value}\">{text}</td>");
        }
        html.push_str("</tr>\n");
    }
    html + "</tbody></table>"
}

fn refused(records: &[&Record]) -> String {
    let mut items = String::new();
    for record in records {
        if let Outcome::Refused(why) = &record.outcome {
            let _ = write!(items, "<li>{}: {}</li>", escape(&record.name()), escape(why));
        }
    }
    if items.is_empty() { items } else { format!("<p>Not run:</p><ul>{items}</ul>") }
}

/// Ground truth, then each technique's defaults with their error; those that were kept.
fn gallery(scene: &str, records: &[&Record], folder: &Path) -> String {
    let mut figures = String::new();
    let keys = std::iter::once((format!("{scene} truth"), "ground truth".to_owned()))
        .chain(records.iter().filter(|record| record.is_default).map(|r| (r.key.clone(), r.name())));
    for (key, name) in keys {
        let Ok(png) = std::fs::read(pictures::path(folder, &key)) else { continue };
        let name = escape(&name);
        let _ = write!(
            figures,
            "<figure><img alt=\"{name}: shaded, and its error\" src=\"{}\"><figcaption>{name}</figcaption></figure>",
            data_uri(&png)
        );
    }
    if figures.is_empty() {
        return figures;
    }
    format!(
        "<div class=\"row\">{figures}</div><p class=\"hint\">Left shaded, right the error: blue too dark, red too light, \
         full at {}.</p>",
        pictures::ERROR_SCALE
    )
}

#[cfg(test)]
mod tests {
    use super::super::record::tests::record;
    use super::*;

    #[test]
    fn a_page_holds_every_scene_and_needs_no_network() {
        let mut records = vec![];
        for scene in ["ball", "<quads>"] {
            records.push(record(scene, "rays 4 skipping", 2.0, 0.1));
            records.push(record(scene, "rays 16 skipping", 8.0, 0.02));
            records.push(record(scene, "shadow-map pcss", 1.0, 0.05));
        }
        let page = page(&records, Path::new("nowhere")).unwrap();
        let html = String::from_utf8(page.html).unwrap();
        assert!(html.contains("&lt;quads&gt;") && !html.contains("<quads>"));
        assert!(html.contains("Over all scenes with penumbrae"));
        assert!(page.charts.len() >= 4 + 2 * 2, "{}", page.charts.len());
        for outside in ["src=\"http", "href=", "@import", "url("] {
            assert!(!html.contains(outside), "{outside}");
        }
    }
}
