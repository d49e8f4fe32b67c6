//! `gnomon scenes`: built-in scenes and their parameters.

use std::fmt::Write;

use scene_core::scenes;
use serde_json::{Value, json};

use crate::console::Console;
use crate::error::CliError;

pub(crate) fn run(console: &Console) -> Result<(), CliError> {
    let mut text = String::new();
    let mut list: Vec<Value> = Vec::new();
    for scene in scenes::all() {
        let _ = writeln!(text, "{}: {}", scene.name, scene.summary);
        list.push(json!({ "name": scene.name, "summary": scene.summary }));
    }
    console.result(&json!({ "scenes": list }), &text)
}
