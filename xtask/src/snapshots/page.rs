//! The page of a failing run: expected | actual | difference.

use std::fmt::Write;

use super::findings::Finding;
use crate::html;

/// The whole page.
pub(super) fn page(found: &[Finding]) -> String {
    let mut body = String::new();
    for finding in found {
        // Writing to a String cannot fail.
        let _ = writeln!(
            body,
            "<section>\n<h2>{}</h2>\n<p>{}</p>\n<div class=\"row\">",
            html::escape(&finding.name()),
            html::escape(&finding.why())
        );
        match finding {
            Finding::Picture { folder, .. } => {
                // Pictures lie beside the page.
                let name = folder.file_name().unwrap_or_default().to_string_lossy();
                for kind in ["expected", "actual", "difference"] {
                    let file = format!("{kind}.png");
                    let shown = if folder.join(&file).exists() {
                        format!("<img src=\"pictures/{}/{file}\" alt=\"{kind}\">", html::escape(&name))
                    } else {
                        "<p>none</p>".to_owned()
                    };
                    let _ = writeln!(body, "<figure>{shown}<figcaption>{kind}</figcaption></figure>");
                }
            }
            Finding::Text { expected, actual, .. } => {
                let expected = expected.as_deref().unwrap_or_default();
                let texts = [
                    ("expected", html::escape(expected)),
                    ("actual", html::escape(actual)),
                    ("difference", difference(expected, actual)),
                ];
                for (kind, text) in texts {
                    let _ =
                        writeln!(body, "<figure><pre>{text}</pre><figcaption>{kind}</figcaption></figure>");
                }
            }
            Finding::LeftOver { .. } => {}
        }
        body.push_str("</div>\n</section>\n");
    }
    html::page("Snapshots that differ", &body)
}

/// Lines of both texts: those of one alone are marked by `-` (expected) and `+` (actual).
fn difference(expected: &str, actual: &str) -> String {
    let (old, new): (Vec<_>, Vec<_>) = (expected.lines().collect(), actual.lines().collect());
    // common[i][j]: lines that old[i..] and new[j..] have in common, in order.
    let mut common = vec![vec![0u32; new.len() + 1]; old.len() + 1];
    for i in (0..old.len()).rev() {
        for j in (0..new.len()).rev() {
            common[i][j] = if old[i] == new[j] {
                common[i + 1][j + 1] + 1
            } else {
                common[i + 1][j].max(common[i][j + 1])
            };
        }
    }
    let (mut i, mut j, mut text) = (0, 0, String::new());
    while i < old.len() || j < new.len() {
        let keep = i < old.len() && j < new.len() && old[i] == new[j];
        let remove = !keep && i < old.len() && (j == new.len() || common[i + 1][j] >= common[i][j + 1]);
        let _ = if keep {
            writeln!(text, "  {}", html::escape(old[i]))
        } else if remove {
            writeln!(text, "<del>- {}</del>", html::escape(old[i]))
        } else {
            writeln!(text, "<ins>+ {}</ins>", html::escape(new[j]))
        };
        i += usize::from(keep || remove);
        j += usize::from(!remove);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_one_text_alone_are_marked() {
        assert_eq!(
            difference("a\nb\nc\n", "a\nx<\nc\nd\n"),
            "  a\n<del>- b</del>\n<ins>+ x&lt;</ins>\n  c\n<ins>+ d</ins>\n"
        );
        assert_eq!(difference("", "a\n"), "<ins>+ a</ins>\n");
        assert_eq!(difference("a\n", ""), "<del>- a</del>\n");
    }
}
