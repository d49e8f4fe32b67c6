//! `index.html`: a page that needs no network, with a slider between any two images and a table to sort.
//!
//! Every image is in it once, as a figure of the gallery; the slider takes it from there. Without scripts,
//! table and gallery remain.

use std::fmt::Write;

use image::DynamicImage;

use super::html::{data_uri, escape, fill};
use super::skipped::lines;
use super::table::{COLUMNS, cells, error_text, rows, sort_keys};
use super::{Comparison, percent, thousands};
use crate::error::{CliError, count_of};
use crate::picture;
use crate::picture::error_map::diverging;

/// The script that sorts tables by their headings, for every page that has some.
pub(crate) const SORT: &str = include_str!("page/sort.js");

/// Writes the page.
pub(crate) fn page(comparison: &Comparison) -> Result<Vec<u8>, CliError> {
    let truth = &comparison.truth;
    let css = fill(include_str!("page/page.css"), &[("stops", &colour_stops())]);
    let values = [
        ("version", env!("CARGO_PKG_VERSION").to_owned()),
        ("scene", escape(&truth.report.scene)),
        ("css", css),
        ("js", include_str!("page/page.js").to_owned()),
        ("sort", SORT.to_owned()),
        ("facts", facts(comparison)),
        ("valid", thousands(truth.valid)),
        ("thead", table_head()),
        ("tbody", table_body(comparison)),
        ("skipped", skipped(comparison)),
        ("refused", refused(comparison)),
        ("scale", comparison.error_scale.to_string()),
        ("gallery", gallery(comparison)?),
        ("samples", escape(&truth.report.variant)),
        ("noise", error_text(truth.noise)),
        ("threads", count_of(rayon::current_num_threads(), "thread")),
    ];
    let values: Vec<(&str, &str)> = values.iter().map(|(key, value)| (*key, value.as_str())).collect();
    Ok(fill(include_str!("page/page.html"), &values).into_bytes())
}

/// The error colours from −1 to 1, for a gradient.
fn colour_stops() -> String {
    let stop = |i: i32| {
        let [r, g, b] = diverging(i as f32 / 8.0);
        format!("rgb({r} {g} {b})")
    };
    (-8..=8).map(stop).collect::<Vec<_>>().join(", ")
}

fn facts(comparison: &Comparison) -> String {
    let truth = &comparison.truth;
    let run = &truth.report;
    let soft = if run.light.extended { "" } else { ", without extent" };
    let facts = [
        ("triangles", thousands(run.triangles)),
        ("pixels", format!("{} × {}", run.width, run.height)),
        ("light", format!("{}: {}{soft}", run.light.index, run.light.kind)),
        ("compared pixels", format!("{} of {} seen", thousands(truth.valid), thousands(truth.seen))),
        ("lit", percent(truth.shares.lit)),
        ("penumbra", percent(truth.shares.penumbra)),
        ("umbra", percent(truth.shares.umbra)),
    ];
    let fact =
        |(name, value): (&str, String)| format!("<div><dt>{name}</dt><dd>{}</dd></div>\n", escape(&value));
    facts.map(fact).concat()
}

fn table_head() -> String {
    let heading = |(name, title): (&str, &str)| {
        format!(
            "<th scope=\"col\"><button type=\"button\" title=\"{}\">{}</button></th>",
            escape(title),
            escape(name)
        )
    };
    format!("<tr>{}</tr>", COLUMNS.map(heading).concat())
}

fn table_body(comparison: &Comparison) -> String {
    /// Columns where the smallest figure is the best: the errors.
    const BEST: std::ops::Range<usize> = 2..6;
    let keys: Vec<_> = rows(comparison).map(|row| sort_keys(&row)).collect();
    // With one technique "best" says nothing.
    let smallest = |column: usize| {
        let values = keys.iter().filter_map(|keys| keys[column]);
        (comparison.entries.len() > 1).then(|| values.fold(f64::INFINITY, f64::min))
    };
    let mut body = String::new();
    for (row, keys) in rows(comparison).zip(&keys) {
        let class = if row.errors.is_none() { " class=\"truth\"" } else { "" };
        let cells = cells(&row);
        let label = escape(&cells[0]);
        let _ = write!(body, "<tr{class}><th scope=\"row\" data-value=\"{label}\">{label}</th>");
        for (column, (cell, key)) in cells[1..].iter().zip(keys).enumerate() {
            let best = BEST.contains(&column) && key.is_some() && *key == smallest(column);
            let class = if best { " class=\"best\"" } else { "" };
            let value = key.map_or(String::new(), |key| key.to_string());
            let _ = write!(body, "<td{class} data-value=\"{value}\">{cell}</td>");
        }
        body.push_str("</tr>\n");
    }
    body
}

/// What every run left out.
fn skipped(comparison: &Comparison) -> String {
    let item =
        |(label, words): (&str, String)| format!("<dt>{}</dt><dd>{}</dd>\n", escape(label), escape(&words));
    let items: String = lines(comparison).into_iter().map(item).collect();
    if items.is_empty() {
        return items;
    }
    format!(
        "<h3>Left out because it cannot change the image</h3>\n<dl class=\"words skipped\">\n{items}</dl>"
    )
}

fn refused(comparison: &Comparison) -> String {
    let item = |r: &super::Refused| format!("<li>{}: {}</li>\n", escape(&r.technique), escape(&r.why));
    let items: String = comparison.refused.iter().map(item).collect();
    if items.is_empty() { items } else { format!("<p>Not run:</p>\n<ul>\n{items}</ul>") }
}

/// A row of figures for ground truth and for each technique.
fn gallery(comparison: &Comparison) -> Result<String, CliError> {
    let mut html = String::new();
    let truth = &comparison.truth;
    let none = None;
    let runs = std::iter::once(("ground truth", &truth.pictures, none))
        .chain(comparison.entries.iter().map(|e| (e.label.as_str(), &e.pictures, Some(&e.error_map))));
    for (run, (name, pictures, error_map)) in runs.enumerate() {
        let mut kinds: Vec<(&str, DynamicImage)> = vec![
            ("shaded", pictures.shaded.clone().into()),
            ("visibility", pictures.visibility.clone().into()),
        ];
        kinds.extend(error_map.map(|map| ("error", map.clone().into())));
        let name = escape(name);
        let _ = writeln!(html, "<h3>{name}</h3>\n<div class=\"row\">");
        for (kind, image) in kinds {
            let png = picture::png(image)?;
            let alt = alt_text(kind, &name);
            let _ = writeln!(
                html,
                "<figure><img id=\"{kind}-{run}\" data-run=\"{run}\" data-kind=\"{kind}\" data-name=\"{name}\" \
                 data-label=\"{name}: {kind}\" alt=\"{alt}\" src=\"{}\"><figcaption>{kind}</figcaption></figure>",
                data_uri(&png)
            );
        }
        html.push_str("</div>\n");
    }
    Ok(html)
}

fn alt_text(kind: &str, name: &str) -> String {
    match kind {
        "shaded" => format!("The scene, shaded with the shadows of {name}"),
        "visibility" => format!("Visibility by {name} in grey: black is umbra, white is lit"),
        _ => format!("Signed error of {name}: blue is too dark, white right, red too light"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gradient_is_the_error_maps_own() {
        let stops = colour_stops();
        assert_eq!(stops.matches("rgb(").count(), 17);
        let [r, g, b] = diverging(-1.0);
        assert!(stops.starts_with(&format!("rgb({r} {g} {b})")));
    }

    #[test]
    fn the_template_asks_for_nothing_that_is_not_given() {
        let template = include_str!("page/page.html");
        for external in ["http:", "https:", "src=\"", "@import", "url("] {
            assert!(!template.contains(external), "{external}");
        }
    }
}
