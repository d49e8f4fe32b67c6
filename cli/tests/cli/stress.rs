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

#[test]
fn cells_are_chosen_by_their_names() {
    let work = Workbench::new();
    let cells = |names: &[&str]| -> Vec<(String, String)> {
        let asked = ["stress", "--quick", "--json", "--techniques", "shadow-map"].iter().chain(names);
        let report = work.done(&asked.copied().collect::<Vec<_>>()).json();
        let text = |cell: &serde_json::Value, key: &str| cell[key].as_str().unwrap().to_owned();
        let cells = report["cells"].as_array().unwrap();
        cells.iter().map(|cell| (text(cell, "technique"), text(cell, "trial"))).collect()
    };
    let of_maps = |trial: &str| ("shadow-map hard".to_owned(), trial.to_owned());
    assert_eq!(cells(&["--cells", "one triangle"]), [of_maps("one triangle")]);
    // What a trial is held against is there, too.
    assert_eq!(cells(&["--cells", "needle"]), [of_maps("quads"), of_maps("quads, needle triangles")]);
    let both = cells(&["--cells", "nothing", "--cells", "at infinity"]);
    assert_eq!(both, [("loading".to_owned(), "a corner at infinity".to_owned()), of_maps("nothing")]);
    let said = work.run(&["stress", "--quick", "--cells", "a million"]);
    assert_eq!(said.code, 2);
    assert!(said.stderr.contains("no scene of this test has a million in its name"), "{}", said.stderr);
}
