//! `gnomon stress`: the short version of the suite, by every technique.

use crate::workbench::Workbench;

#[test]
fn every_technique_stands_the_short_suite() {
    let work = Workbench::new();
    let said = work.done(&["stress", "--quick", "--json"]);
    let report = said.json();
    let cells = report["cells"].as_array().unwrap();
    assert_eq!(report["failed"], 0);
    assert_eq!(report["passed"].as_u64().unwrap() + report["refused"].as_u64().unwrap(), cells.len() as u64);
    let bounded = cells.iter().filter(|cell| cell["bound"].is_number()).count();
    assert!(bounded * 4 > cells.len(), "few of {} cells have a bound: {bounded}", cells.len());
}
