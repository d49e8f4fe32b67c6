//! `cargo xtask bench [NAME…] [-- ARGUMENTS]`: runs the benches and collects what they print.
//!
//! Into `target/bench`: `bench.csv`, one figure a line with commit and machine, and `index.html`, the same as tables
//! and what each bench printed. Two kinds of figures are found: those that criterion keeps, and tables that a bench
//! prints as `| cells |`. Speeds of one run may be compared with each other, not with those of another machine.

mod collect;

use std::fs;
use std::time::SystemTime;

use self::collect::{Figure, criterion, printed_tables};
use crate::html;
use crate::package::packages;
use crate::shell::{CheckError, cargo_output, output_of, target};

pub(crate) fn run(names: &[String], arguments: &[String]) -> Result<(), CheckError> {
    let wanted = |package: &str, bench: &str| {
        names.is_empty()
            || names
                .iter()
                .any(|name| name == bench || name == package || format!("gnomon-{name}") == package)
    };
    let (mut figures, mut printed) = (Vec::new(), Vec::new());
    let mut count = 0;
    for package in packages()? {
        for bench in package.benches.iter().filter(|bench| wanted(&package.name, bench)) {
            count += 1;
            let start = SystemTime::now();
            let mut line = vec!["bench", "--package", &package.name, "--bench", bench, "--"];
            line.extend(arguments.iter().map(String::as_str));
            let output = cargo_output(&line)?;
            print!("{output}");
            let place = (package.name.clone(), bench.clone());
            let mut found = criterion(&target().join("criterion"), start)?;
            found.extend(printed_tables(&output));
            figures.extend(found.into_iter().map(|figure| (place.clone(), figure)));
            printed.push((place, output));
        }
    }
    if count == 0 {
        return Err(CheckError::Failed(format!("no bench is called {}", names.join(" or "))));
    }
    let machine = Machine::new();
    let folder = target().join("bench");
    let files = [("bench.csv", csv(&machine, &figures)), ("index.html", page(&machine, &figures, &printed))];
    for (name, text) in files {
        let path = folder.join(name);
        fs::create_dir_all(&folder)
            .and_then(|()| fs::write(&path, text))
            .map_err(|source| CheckError::Write { path: path.clone(), source })?;
        eprintln!("==> wrote {}", path.display());
    }
    Ok(())
}

/// Package and bench.
type Place = (String, String);

/// What was measured on.
#[derive(Clone, Debug, Default)]
struct Machine {
    commit: String,
    processor: String,
    threads: usize,
    system: String,
}

impl Machine {
    fn new() -> Self {
        let asks = |program: &str, arguments: &[&str]| {
            output_of(program, arguments).map_or_else(|_| "unknown".to_owned(), |text| text.trim().to_owned())
        };
        let is_dirty = !asks("git", &["status", "--porcelain"]).is_empty();
        let commit =
            asks("git", &["rev-parse", "--short=12", "HEAD"]) + if is_dirty { "+changes" } else { "" };
        let about = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        let model = about
            .lines()
            .find_map(|line| Some(line.strip_prefix("model name")?.split_once(':')?.1.trim().to_owned()));
        Self {
            commit,
            processor: model.unwrap_or_else(|| std::env::consts::ARCH.to_owned()),
            threads: std::thread::available_parallelism().map_or(1, usize::from),
            system: std::env::consts::OS.to_owned(),
        }
    }
}

fn csv(machine: &Machine, figures: &[(Place, Figure)]) -> String {
    let quote = |cell: &str| {
        if cell.contains([',', '"', '\n']) {
            format!("\"{}\"", cell.replace('"', "\"\""))
        } else {
            cell.to_owned()
        }
    };
    let mut text = "commit,processor,threads,system,package,bench,row,column,value\n".to_owned();
    for ((package, bench), figure) in figures {
        let threads = machine.threads.to_string();
        let cells = [
            &machine.commit,
            &machine.processor,
            &threads,
            &machine.system,
            package,
            bench,
            &figure.row,
            &figure.column,
            &figure.value,
        ];
        text += &cells.map(|cell| quote(cell)).join(",");
        text.push('\n');
    }
    text
}

fn page(machine: &Machine, figures: &[(Place, Figure)], printed: &[(Place, String)]) -> String {
    let mut body = format!(
        "<p>{}, {} threads, {}; commit {}</p>\n",
        html::escape(&machine.processor),
        machine.threads,
        html::escape(&machine.system),
        html::escape(&machine.commit)
    );
    for (place, output) in printed {
        body += &format!("<h2>{}: {}</h2>\n", html::escape(&place.0), html::escape(&place.1));
        let own: Vec<&Figure> =
            figures.iter().filter(|(other, _)| other == place).map(|(_, figure)| figure).collect();
        if !own.is_empty() {
            body += "<table>\n";
            for row in own.chunk_by(|a, b| a.row == b.row) {
                let cells = row.iter().map(|f| {
                    format!("<td title=\"{}\">{}</td>", html::escape(&f.column), html::escape(&f.value))
                });
                body += &format!(
                    "<tr><th>{}</th>{}</tr>\n",
                    html::escape(&row[0].row),
                    cells.collect::<String>()
                );
            }
            body += "</table>\n";
        }
        body +=
            &format!("<details><summary>as printed</summary><pre>{}</pre></details>\n", html::escape(output));
    }
    html::page("Benchmarks", &body)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_holds_one_figure_with_where_it_was_measured() {
        let machine =
            Machine { commit: "c".into(), processor: "p, q".into(), threads: 2, system: "s".into() };
        let figure = Figure { row: "r".into(), column: "ms".into(), value: "1.5".into() };
        let text = csv(&machine, &[(("a".into(), "b".into()), figure.clone())]);
        assert_eq!(text.lines().nth(1), Some("c,\"p, q\",2,s,a,b,r,ms,1.5"));
        let page = page(
            &machine,
            &[(("a".into(), "b".into()), figure)],
            &[(("a".into(), "b".into()), "<out>".into())],
        );
        assert!(page.contains("<th>r</th><td title=\"ms\">1.5</td>") && page.contains("&lt;out&gt;"));
    }
}
