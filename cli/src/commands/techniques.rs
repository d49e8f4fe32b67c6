//! `gnomon techniques`: what there is, and what can be set.

use std::fmt::Write;

use scene_core::technique::{Capability, SettingKind, Support, TechniqueFactory};
use serde_json::{Value, json};

use crate::args::TechniquesArgs;
use crate::console::Console;
use crate::error::CliError;
use crate::techniques;

pub(crate) fn run(args: &TechniquesArgs, console: &Console) -> Result<(), CliError> {
    let shown = match &args.name {
        Some(name) => vec![techniques::find(name)?],
        None => techniques::all().to_vec(),
    };
    let (mut text, mut list) = (String::new(), Vec::new());
    for factory in shown {
        let technique = factory.create(None, &[])?;
        let support = support(&technique.describe());
        let defaults = technique.settings();
        if !text.is_empty() {
            text.push('\n');
        }
        describe(&mut text, factory, &support, &defaults);
        list.push(as_json(factory, &support, &defaults)?);
    }
    console.result(&json!({ "techniques": list }), &text)
}

/// How a technique at its defaults serves each input.
fn support(description: &scene_core::technique::Description) -> Vec<(String, Support)> {
    Capability::ALL.into_iter().map(|c| (word(&c), description.support(c))).collect()
}

/// The name that serde gives a value.
fn word(value: &impl serde::Serialize) -> String {
    serde_json::to_value(value).ok().and_then(|v| v.as_str().map(str::to_owned)).unwrap_or_default()
}

fn describe(
    text: &mut String,
    factory: &dyn TechniqueFactory,
    support: &[(String, Support)],
    defaults: &Value,
) {
    // Writing to a string cannot fail.
    let _ = writeln!(text, "{}: {}", factory.name(), factory.summary());
    let _ = writeln!(text, "\n  takes");
    let width = support.iter().map(|(name, _)| name.len()).max().unwrap_or(0);
    for (name, support) in support {
        let answer = match support {
            Support::Exact => "exact".to_owned(),
            Support::Approximate(why) => format!("approximate: {why}"),
            Support::Unsupported(why) => format!("no: {why}"),
        };
        let _ = writeln!(text, "    {:width$}  {answer}", name.replace('_', " "));
    }
    let _ = writeln!(text, "\n  settings (--set key=value)");
    let width = factory.settings().iter().map(|setting| setting.name.len()).max().unwrap_or(0);
    for setting in factory.settings() {
        let default = plain(&defaults[setting.name]);
        let unit = if setting.unit.is_empty() { String::new() } else { format!(", in {}", setting.unit) };
        let range = setting.kind.expected();
        let _ = writeln!(text, "    {:width$}  {}", setting.name, setting.doc);
        let _ = writeln!(text, "    {:width$}  {range}{unit}; default {default}", "");
    }
    let presets = factory.presets();
    if !presets.is_empty() {
        let _ = writeln!(text, "\n  presets, fastest first (--preset)\n    {}", presets.join(", "));
    }
}

fn as_json(
    factory: &dyn TechniqueFactory,
    support: &[(String, Support)],
    defaults: &Value,
) -> Result<Value, CliError> {
    let settings: Vec<Value> = factory
        .settings()
        .iter()
        .map(|setting| {
            let (kind, range) = match setting.kind {
                SettingKind::Bool => ("bool", Value::Null),
                SettingKind::Int { min, max } => ("int", json!([min, max])),
                SettingKind::Float { min, max } => ("float", json!([min, max])),
                SettingKind::Choice(words) => ("choice", json!(words)),
            };
            json!({
                "name": setting.name,
                "kind": kind,
                "range": range,
                "unit": setting.unit,
                "default": defaults[setting.name],
                "doc": setting.doc,
            })
        })
        .collect();
    let mut presets = serde_json::Map::new();
    for preset in factory.presets() {
        presets.insert(preset.to_owned(), factory.create(Some(preset), &[])?.settings());
    }
    // A technique without the setting has one variant, made without naming it.
    let names = techniques::variants(factory);
    let overrides = names.iter().map(|name| vec![("variant".to_owned(), (*name).to_owned())]);
    let overrides: Vec<_> = if names.is_empty() { vec![Vec::new()] } else { overrides.collect() };
    let mut variants = Vec::new();
    for overrides in overrides {
        let technique = factory.create(None, &overrides)?;
        let takes = takes(&self::support(&technique.describe()));
        variants.push(json!({ "name": techniques::variant_of(technique.as_ref()), "takes": takes }));
    }
    Ok(json!({
        "name": factory.name(),
        "summary": factory.summary(),
        "takes": takes(support),
        "variants": variants,
        "settings": settings,
        "preset_order": factory.presets(),
        "presets": presets,
    }))
}

/// How each input is served, by name.
fn takes(support: &[(String, Support)]) -> Value {
    let answer = |(name, support): &(String, Support)| {
        let (answer, why) = match *support {
            Support::Exact => ("exact", None),
            Support::Approximate(why) => ("approximate", Some(why)),
            Support::Unsupported(why) => ("unsupported", Some(why)),
        };
        (name.clone(), json!({ "support": answer, "why": why }))
    };
    Value::Object(support.iter().map(answer).collect())
}

/// A JSON value as one would type it.
fn plain(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}
