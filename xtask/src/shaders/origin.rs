//! From a line of linked WGSL back to the file and line it was written in.

use std::fs;

use gnomon_shader_build::{Declaration, LinkedShader};

/// `file:line` of a line (from 1) of the linked text, or the shader's file alone if there is no line.
///
/// Linking rewrites spacing and names, declaration by declaration: the line is found within the declaration it
/// belongs to, by its words; where it was rewritten beyond recognition, the declaration's first line stands.
pub(super) fn place(shader: &LinkedShader, line: Option<u32>) -> String {
    let found = line.and_then(|line| {
        let line = line as usize - 1;
        let declaration = declaration_at(shader, line)?;
        let source = fs::read_to_string(&declaration.file).ok()?;
        let text = shader.wgsl.lines().nth(line)?;
        Some(format!("{}:{}", declaration.file.display(), line_in(shader, declaration, &source, text)?))
    });
    found.unwrap_or_else(|| shader.path.display().to_string())
}

/// The line (from 1) of the linked text that declares `name`.
pub(super) fn line_of(shader: &LinkedShader, name: &str) -> Option<u32> {
    let line = shader.wgsl.lines().position(|line| declared_name(line) == Some(name))?;
    u32::try_from(line + 1).ok()
}

/// The last declaration that opens at or before this line (from 0). Declarations open at the left margin.
fn declaration_at(shader: &LinkedShader, line: usize) -> Option<&Declaration> {
    let lines: Vec<_> = shader.wgsl.lines().take(line + 1).collect();
    lines.iter().rev().find_map(|line| {
        let name = declared_name(line)?;
        shader.declarations.iter().find(|declaration| declaration.linked_name == name)
    })
}

/// The name that a line declares at module scope.
fn declared_name(line: &str) -> Option<&str> {
    const KEYWORDS: [&str; 6] = ["fn", "struct", "const", "var", "alias", "override"];
    if line.starts_with(char::is_whitespace) {
        return None;
    }
    let line = line.split("//").next()?;
    let mut words = words(line);
    words.find(|word| KEYWORDS.contains(word))?;
    // After `var` come the address space and access mode.
    const SPACES: [&str; 9] =
        ["storage", "uniform", "private", "workgroup", "handle", "function", "read", "write", "read_write"];
    words.find(|word| !SPACES.contains(word))
}

fn words(line: &str) -> impl Iterator<Item = &str> {
    line.split(|c: char| !c.is_alphanumeric() && c != '_').filter(|word| !word.is_empty())
}

/// The line (from 1) of `source` that `text`, a line of the declaration as linked, was written as.
fn line_in(shader: &LinkedShader, declaration: &Declaration, source: &str, text: &str) -> Option<usize> {
    let plain = |line: &str| line.split("//").next().unwrap_or("").split_whitespace().collect::<String>();
    let mut wanted = text.to_owned();
    for other in &shader.declarations {
        wanted = wanted.replace(&other.linked_name, &other.name);
    }
    let wanted = plain(&wanted);
    let opens = source.lines().position(|line| declared_name(line) == Some(&declaration.name))?;
    // Its attributes may stand on the lines before, its body ends before the next declaration.
    let body = source.lines().skip(opens + 1).take_while(|line| declared_name(line).is_none()).count();
    let same = source.lines().enumerate().skip(opens).take(body + 1).find(|(_, line)| plain(line) == wanted);
    Some(same.map_or(opens, |(line, _)| line) + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_found_at_the_margin_only() {
        assert_eq!(declared_name("@compute @workgroup_size(8) fn main() {"), Some("main"));
        assert_eq!(
            declared_name("@group(0) @binding(1) var<storage, read_write> out: array<f32>;"),
            Some("out")
        );
        assert_eq!(declared_name("const N: u32 = 3u;"), Some("N"));
        assert_eq!(declared_name("    let a = 1;"), None);
        assert_eq!(declared_name("// fn f"), None);
    }
}
