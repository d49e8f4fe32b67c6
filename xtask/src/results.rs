//! `cargo xtask results [WORD…]`: makes the figures in the pages anew.
//!
//! A page holds blocks that say how they are made:
//!
//! ```text
//! <!-- run: gnomon stress -->
//! … what that printed …
//! <!-- end -->
//! ```
//!
//! `gnomon …` is the command of this workspace, `example PACKAGE NAME …` an example of a crate, `bench PACKAGE NAME …` a bench, `copy FROM
//! TO` a file that an earlier block left. Blocks run in the order of the page; with words only those whose line holds one of them. A
//! page is written after each: all of them take hours. Times in it are those of the machine it ran on.

use std::fs;
use std::time::Instant;

use crate::shell::{CheckError, cargo, cargo_output, output_of, root, target};
use crate::vulkan;

/// The pages with blocks, in the order in which they are made: README takes pictures that RESULTS leaves.
const PAGES: [&str; 2] = ["RESULTS.md", "README.md"];

const BEGIN: &str = "<!-- run: ";
const CLOSE: &str = " -->";
const END: &str = "<!-- end -->";

/// Builds for release, then runs the blocks.
pub(crate) fn run(words: &[String]) -> Result<(), CheckError> {
    cargo(&["build", "--release", "--workspace"], &[])?;
    for page in PAGES {
        let path = root().join(page);
        let text =
            fs::read_to_string(&path).map_err(|source| CheckError::Read { path: path.clone(), source })?;
        let print = |line: &str| {
            let is_wanted = words.is_empty() || words.iter().any(|word| line.contains(word));
            if !is_wanted {
                return Ok(None);
            }
            eprintln!("\n==> {line}");
            let start = Instant::now();
            let printed = printed(line)?;
            eprintln!("    {:.1} s", start.elapsed().as_secs_f64());
            Ok(Some(printed))
        };
        let write = |page: &str| {
            fs::write(&path, page).map_err(|source| CheckError::Write { path: path.clone(), source })
        };
        remade(&text, page, print, write)?;
    }
    Ok(())
}

/// The page with every block replaced by what `print` says, where it says something; `write` gets it after each of them.
fn remade(
    page: &str,
    name: &str,
    mut print: impl FnMut(&str) -> Result<Option<String>, CheckError>,
    mut write: impl FnMut(&str) -> Result<(), CheckError>,
) -> Result<String, CheckError> {
    let mut made = String::new();
    let mut rest = page;
    while let Some(begin) = rest.find(BEGIN) {
        let block = &rest[begin..];
        let fault = |what: &str| {
            CheckError::Failed(format!("{name}: {what} after '{}'", block.lines().next().unwrap_or_default()))
        };
        let close = block.find(CLOSE).ok_or_else(|| fault("no -->"))?;
        let end = block.find(END).ok_or_else(|| fault("no <!-- end -->"))?;
        let (line, head) = (&block[BEGIN.len()..close], &block[..close + CLOSE.len()]);
        made.push_str(&rest[..begin]);
        let printed = print(line)?;
        let is_new = printed.is_some();
        match printed {
            None => made.push_str(&block[..end]),
            // Nothing printed: the block stands for what it leaves behind.
            Some(printed) if printed.trim().is_empty() => made.push_str(&format!("{head}\n")),
            Some(printed) => made.push_str(&format!("{head}\n{}\n", fenced(&printed))),
        }
        made.push_str(END);
        rest = &block[end + END.len()..];
        if is_new {
            write(&format!("{made}{rest}"))?;
        }
    }
    made.push_str(rest);
    Ok(made)
}

/// Text between fences; a table that is Markdown already as it is.
fn fenced(printed: &str) -> String {
    let printed = printed.trim_end();
    if printed.starts_with('|') {
        return format!("\n{printed}\n");
    }
    let lines: Vec<&str> = printed.lines().map(str::trim_end).collect();
    format!("\n```text\n{}\n```\n", lines.join("\n"))
}

/// What a block's line prints.
fn printed(line: &str) -> Result<String, CheckError> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let environment = vulkan::environment()?;
    match &words[..] {
        ["gnomon", arguments @ ..] => {
            let program = target().join("release").join(format!("gnomon{}", std::env::consts::EXE_SUFFIX));
            // A failed check is a result, too: what it printed goes on the page and says so.
            crate::shell::output_even_if_failed(&program.display().to_string(), arguments, &environment)
        }
        ["example", package, name, arguments @ ..] => {
            let mut command = vec!["run", "--release", "--package", package, "--example", name, "--"];
            command.extend(arguments);
            cargo_output(&command)
        }
        ["bench", package, name, arguments @ ..] => {
            let mut command = vec!["bench", "--package", package, "--bench", name, "--"];
            command.extend(arguments);
            cargo_output(&command)
        }
        ["copy", from, to] => {
            let path = root().join(to);
            fs::copy(root().join(from), &path).map_err(|source| CheckError::Write { path, source })?;
            Ok(String::new())
        }
        ["machine"] => output_of("uname", &["-sm"]),
        _ => Err(CheckError::Failed(format!("'{line}' is nothing a block can run"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAGE: &str =
        "a\n<!-- run: gnomon x -->\nold\n<!-- end -->\nb\n<!-- run: copy p q -->\n<!-- end -->\n";

    fn kept(_: &str) -> Result<(), CheckError> {
        Ok(())
    }

    #[test]
    fn blocks_are_replaced_and_all_else_is_kept() {
        let new = |line: &str| Ok(Some(if line == "gnomon x" { "new \n" } else { "" }.to_owned()));
        let mut written = Vec::new();
        let made = remade(PAGE, "page", new, |page| {
            written.push(page.to_owned());
            Ok(())
        });
        let expected = "a\n<!-- run: gnomon x -->\n\n```text\nnew\n```\n\n<!-- end -->\nb\n<!-- run: copy p q -->\n<!-- end -->\n";
        assert_eq!(made.unwrap(), expected);
        // After the first block all is there, the rest as it was.
        assert_eq!(written, [expected, expected]);
        assert_eq!(remade(PAGE, "page", |_| Ok(None), kept).unwrap(), PAGE);
        // A second time changes nothing.
        assert_eq!(remade(expected, "page", new, kept).unwrap(), expected);
    }

    #[test]
    fn what_is_done_is_written_before_the_rest_fails() {
        let print = |line: &str| match line {
            "gnomon x" => Ok(Some("new".to_owned())),
            _ => Err(CheckError::Failed("no p".to_owned())),
        };
        let mut written = Vec::new();
        let made = remade(PAGE, "page", print, |page| {
            written.push(page.to_owned());
            Ok(())
        });
        assert!(made.is_err());
        assert_eq!(written.len(), 1);
        assert!(written[0].contains("new") && written[0].ends_with("<!-- run: copy p q -->\n<!-- end -->\n"));
    }

    #[test]
    fn tables_are_not_fenced() {
        assert_eq!(fenced("| a |\n| --- |\n"), "\n| a |\n| --- |\n");
    }

    #[test]
    fn a_block_without_end_is_named() {
        let error = remade("<!-- run: gnomon x -->\n", "page", |_| Ok(None), kept).unwrap_err();
        assert!(error.to_string().contains("gnomon x"), "{error}");
    }

    #[test]
    fn every_page_is_well_formed() {
        for page in PAGES {
            let text = fs::read_to_string(root().join(page)).unwrap();
            let mut lines = Vec::new();
            let line = |line: &str| {
                lines.push(line.to_owned());
                Ok(None)
            };
            remade(&text, page, line, kept).unwrap();
            let known = ["gnomon ", "example ", "bench ", "copy ", "machine"];
            assert!(
                lines.iter().all(|line| known.iter().any(|word| line.starts_with(word))),
                "{page}: {lines:?}"
            );
        }
    }
}
