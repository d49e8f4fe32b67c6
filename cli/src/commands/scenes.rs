//! `gnomon scenes`: built-in scenes and their parameters.

use std::fmt::Write;

use scene_core::scenes::{self, BuiltIn};
use serde_json::{Value, json};

use crate::console::Console;
use crate::error::CliError;

pub(crate) fn run(console: &Console) -> Result<(), CliError> {
    let mut text = String::new();
    for scene in scenes::all() {
        describe(&mut text, scene);
    }
    text.push_str("Parameters are set by NAME:key=value,key=value, such as ");
    text.push_str(&example());
    text.push('\n');
    let list: Vec<Value> = scenes::all().iter().map(as_json).collect();
    console.result(&json!({ "scenes": list }), &text)
}

fn describe(text: &mut String, scene: &BuiltIn) {
    // Writing to a string cannot fail.
    let _ = writeln!(text, "{}: {}", scene.name, scene.summary);
    let width = scene.parameters.iter().map(|p| p.name.len()).max().unwrap_or(0);
    for p in scene.parameters {
        let kind = if p.whole { "a whole number" } else { "a number" };
        let _ = writeln!(text, "    {:width$}  {}", p.name, p.doc);
        let _ =
            writeln!(text, "    {:width$}  {kind} from {} to {}; default {}", "", p.min, p.max, p.default);
    }
    text.push('\n');
}

/// A spec that works: the first parameter there is, at its default.
fn example() -> String {
    let with_parameter = scenes::all().iter().find_map(|scene| Some((scene.name, scene.parameters.first()?)));
    with_parameter.map_or(String::new(), |(name, p)| format!("{name}:{}={}", p.name, p.default))
}

fn as_json(scene: &BuiltIn) -> Value {
    let parameters: Vec<Value> = scene
        .parameters
        .iter()
        .map(|p| {
            let kind = if p.whole { "int" } else { "float" };
            let range = [p.min, p.max];
            json!({ "name": p.name, "kind": kind, "range": range, "default": p.default, "doc": p.doc })
        })
        .collect();
    json!({ "name": scene.name, "summary": scene.summary, "parameters": parameters })
}
