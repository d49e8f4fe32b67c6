//! Proofs that the comparator can fail, and that nothing to compare is forgotten.

use libtest_mimic::{Failed, Trial};
use serde_json::{Value, json};

use crate::catalogue::{cases_of, left_over};
use crate::difference::check;
use crate::picture::Picture;

pub(crate) fn trials() -> Vec<Trial> {
    vec![
        Trial::test("controls::a_file_keeps_the_values", a_file_keeps_the_values),
        Trial::test("controls::ties_of_rounding_pass", ties_of_rounding_pass),
        Trial::test("controls::planted_differences_fail", planted_differences_fail),
        Trial::test("controls::every_variant_is_found", every_variant_is_found),
        Trial::test(
            "controls::lights_with_and_without_extent_are_shown",
            lights_with_and_without_extent_are_shown,
        ),
        Trial::test("controls::pictures_of_nothing_are_found", pictures_of_nothing_are_found),
    ]
}

/// A disk of shadow with a soft border, and a row that sees nothing.
fn disk(centre: f32) -> Picture {
    let (width, height) = (128, 96);
    let value = |i: u32| {
        let (x, y) = (i % width, i / width);
        if y == 0 {
            return f32::NAN;
        }
        let distance = (x as f32 - centre).hypot(y as f32 - 48.0);
        ((distance - 30.0) / 8.0).clamp(0.0, 1.0)
    };
    Picture { width, height, values: (0..width * height).map(value).collect() }
}

fn ensure(condition: bool, what: &str) -> Result<(), Failed> {
    if condition { Ok(()) } else { Err(what.into()) }
}

fn a_file_keeps_the_values() -> Result<(), Failed> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("picture.png");
    std::fs::write(&path, disk(64.0).png())?;
    let figures = check(&disk(64.0), &Picture::read(&path)?)?;
    ensure(figures.wrong == 0 && figures.max <= 0.5 / 65535.0 + f32::EPSILON, &format!("{figures:?}"))
}

fn ties_of_rounding_pass() -> Result<(), Failed> {
    let mut other = disk(64.0);
    // Twelve of 12,288 pixels may be wrong, however wrong they are.
    for (i, value) in other.values.iter_mut().filter(|v| !v.is_nan()).take(12).enumerate() {
        *value = if i == 0 { f32::NAN } else { 1.0 - *value };
    }
    check(&disk(64.0), &other).map(|_| ()).map_err(Failed::from)
}

/// Each of these is a mistake that a technique could make.
fn planted_differences_fail() -> Result<(), Failed> {
    let change = |alter: fn(usize, &mut f32)| {
        let mut picture = disk(64.0);
        picture.values.iter_mut().enumerate().for_each(|(i, value)| alter(i, value));
        picture
    };
    let planted = [
        ("a shadow moved by half a pixel", disk(64.5)),
        ("a shadow that is not there", change(|_, v| *v = v.max(1.0))),
        (
            "thirteen wrong pixels",
            change(|i, v| {
                if (200..213).contains(&i) {
                    *v = 1.0 - *v;
                }
            }),
        ),
        (
            "a column that sees nothing",
            change(|i, v| {
                if i % 128 == 5 {
                    *v = f32::NAN;
                }
            }),
        ),
        ("all of it a little too dark", change(|_, v| *v -= 0.003)),
    ];
    for (what, picture) in planted {
        ensure(check(&disk(64.0), &picture).is_err(), what)?;
        ensure(check(&picture, &disk(64.0)).is_err(), what)?;
    }
    let narrow = Picture { width: 127, values: vec![1.0; 127 * 96], ..disk(64.0) };
    ensure(check(&disk(64.0), &narrow).is_err(), "another size")
}

fn listed(variants: &[(&str, &str)]) -> Value {
    let takes = |gpu: &str| json!({ "rect_light": { "support": "exact" }, "gpu": { "support": gpu } });
    let variants: Vec<Value> =
        variants.iter().map(|(name, gpu)| json!({ "name": name, "takes": takes(gpu) })).collect();
    json!({ "techniques": [{ "name": "t", "settings": [{ "name": "variant" }], "variants": variants }] })
}

fn every_variant_is_found() -> Result<(), Failed> {
    let names = |variants| -> Vec<String> { cases_of(&listed(variants)).iter().map(|c| c.name()).collect() };
    ensure(names(&[("a", "unsupported")]) == ["t::a::ball::cpu"], "one variant")?;
    let found = names(&[("a", "exact"), ("b", "unsupported")]);
    ensure(found == ["t::a::ball::cpu", "t::a::ball::gpu", "t::b::ball::cpu"], &format!("{found:?}"))
}

fn lights_with_and_without_extent_are_shown() -> Result<(), Failed> {
    let scenes = |takes: Value| -> Vec<&str> {
        let variants = [json!({ "name": "a", "takes": takes })];
        let technique = json!({ "name": "t", "settings": [], "variants": variants });
        cases_of(&json!({ "techniques": [technique] })).iter().map(|case| case.scene).collect()
    };
    let support = |support: &str| json!({ "support": support });
    let gpu = || support("unsupported");
    let (exact, approximate) = (|| support("exact"), || support("approximate"));
    let both = json!({ "rect_light": approximate(), "sun": exact(), "spot_light": exact(), "gpu": gpu() });
    ensure(scenes(both) == ["pool", "chess"], "exact before approximate, extended before point")?;
    ensure(scenes(json!({ "spot_light": exact(), "gpu": gpu() })) == ["chess"], "a hard technique")?;
    ensure(scenes(json!({ "sphere_light": approximate(), "gpu": gpu() })) == ["knot"], "a soft technique")
}

fn pictures_of_nothing_are_found() -> Result<(), Failed> {
    let folder = tempfile::tempdir()?;
    std::fs::create_dir(folder.path().join("t"))?;
    for name in ["t/a-ball.png", "t/gone-ball.png", "stray.png"] {
        std::fs::write(folder.path().join(name), "")?;
    }
    let left_over = left_over(&cases_of(&listed(&[("a", "exact")])), folder.path());
    let expected = ["stray.png", "t/gone-ball.png"].map(|name| folder.path().join(name));
    ensure(left_over == expected, &format!("{left_over:?}"))
}
