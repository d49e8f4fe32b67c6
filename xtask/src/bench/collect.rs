//! Figures of benches: those that criterion keeps, and tables that are printed.

use std::fs;
use std::path::Path;
use std::time::SystemTime;

use serde_json::Value;

use crate::shell::CheckError;

/// One number, or word, of a table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Figure {
    pub(super) row: String,
    pub(super) column: String,
    pub(super) value: String,
}

/// What criterion measured since `start`: mean and its 95 % interval, in milliseconds.
pub(super) fn criterion(folder: &Path, start: SystemTime) -> Result<Vec<Figure>, CheckError> {
    let mut figures = Vec::new();
    let Ok(entries) = fs::read_dir(folder) else { return Ok(figures) };
    let mut paths: Vec<_> =
        entries.flatten().map(|entry| entry.path()).filter(|path| path.is_dir()).collect();
    paths.sort();
    for path in paths {
        if path.file_name().is_some_and(|name| name == "new") {
            figures.extend(measured(&path, start)?);
        } else {
            figures.extend(criterion(&path, start)?);
        }
    }
    Ok(figures)
}

fn measured(folder: &Path, start: SystemTime) -> Result<Vec<Figure>, CheckError> {
    let estimates = folder.join("estimates.json");
    let is_new = fs::metadata(&estimates).and_then(|data| data.modified()).is_ok_and(|time| time >= start);
    if !is_new {
        return Ok(Vec::new());
    }
    let json = |path: &Path| -> Result<Value, CheckError> {
        let bytes = fs::read(path).map_err(|source| CheckError::Read { path: path.to_owned(), source })?;
        serde_json::from_slice(&bytes)
            .map_err(|error| CheckError::Failed(format!("{}: {error}", path.display())))
    };
    let (estimates, benchmark) = (json(&estimates)?, json(&folder.join("benchmark.json"))?);
    let row = benchmark["full_id"].as_str().unwrap_or_default().to_owned();
    let mean = &estimates["mean"];
    let interval = &mean["confidence_interval"];
    let columns = [
        ("mean ms", &mean["point_estimate"]),
        ("from ms", &interval["lower_bound"]),
        ("to ms", &interval["upper_bound"]),
    ];
    let figure = |(column, nanoseconds): (&str, &Value)| {
        let value = format!("{:.6}", nanoseconds.as_f64()? * 1e-6);
        Some(Figure { row: row.clone(), column: column.to_owned(), value })
    };
    Ok(columns.into_iter().filter_map(figure).collect())
}

/// Cells of the tables `| … |` in a text; the first line of each names the columns, the first cell of each line its row.
pub(super) fn printed_tables(text: &str) -> Vec<Figure> {
    let mut figures = Vec::new();
    let mut columns: Vec<String> = Vec::new();
    for line in text.lines().map(str::trim) {
        let Some(inner) = line.strip_prefix('|').and_then(|rest| rest.strip_suffix('|')) else {
            columns.clear();
            continue;
        };
        let cells: Vec<&str> = inner.split('|').map(str::trim).collect();
        if columns.is_empty() {
            columns = cells.into_iter().map(str::to_owned).collect();
        } else if !cells.iter().all(|cell| !cell.is_empty() && cell.chars().all(|c| c == '-' || c == ':')) {
            let cell = |(column, value): (&String, &&str)| Figure {
                row: cells[0].to_owned(),
                column: column.clone(),
                value: (*value).to_owned(),
            };
            figures.extend(columns.iter().zip(&cells).skip(1).map(cell));
        }
    }
    figures
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn tables_are_read_by_row_and_column() {
        let text = "warm up\n| scene | all s | skip s |\n|---|--:|--:|\n| ball | 1.5 | 0.5 |\nend\n| a |\n";
        let figure = |column: &str, value: &str| Figure {
            row: "ball".into(),
            column: column.into(),
            value: value.into(),
        };
        assert_eq!(printed_tables(text), [figure("all s", "1.5"), figure("skip s", "0.5")]);
        assert!(printed_tables("time: [1 ms 2 ms]\n").is_empty());
    }

    #[test]
    fn criterion_is_read_if_it_is_of_this_run() {
        let folder = tempfile::tempdir().unwrap();
        let new = folder.path().join("group/bench/new");
        fs::create_dir_all(&new).unwrap();
        let interval = "\"confidence_interval\":{\"lower_bound\":1e6,\"upper_bound\":3e6}";
        fs::write(new.join("estimates.json"), format!("{{\"mean\":{{\"point_estimate\":2e6,{interval}}}}}"))
            .unwrap();
        fs::write(new.join("benchmark.json"), "{\"full_id\":\"group/bench\"}").unwrap();
        let now = SystemTime::now();
        let found = criterion(folder.path(), now - Duration::from_secs(60)).unwrap();
        let values: Vec<_> = found.iter().map(|f| (f.column.as_str(), f.value.as_str())).collect();
        assert_eq!(values, [("mean ms", "2.000000"), ("from ms", "1.000000"), ("to ms", "3.000000")]);
        assert_eq!(found[0].row, "group/bench");
        assert!(criterion(folder.path(), now + Duration::from_secs(60)).unwrap().is_empty());
        assert!(criterion(&folder.path().join("none"), now).unwrap().is_empty());
    }
}
