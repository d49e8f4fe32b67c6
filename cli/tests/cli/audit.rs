//! `gnomon audit`: skipping changes no image.

use crate::workbench::Workbench;

#[test]
fn skipping_changes_no_image() {
    let work = Workbench::new();
    let line = ["audit", "street", "ball", "--variants", "--size", "64x48", "--runs", "1", "--json"];
    let said = work.done(&line);
    let report = said.json();
    let cells = report["cells"].as_array().unwrap();
    assert!(cells.iter().all(|cell| cell["differing_pixels"] == 0));
    // Something was left out, or there is nothing to audit.
    let some = cells.iter().filter(|cell| cell["left_out"] != "nothing").count();
    assert!(some * 2 > cells.len(), "{some} of {} cells left something out", cells.len());
}

#[test]
fn rows_have_a_heading() {
    let work = Workbench::new();
    let line = ["audit", "ball", "--techniques", "psm,shadow-map", "--size", "32x24", "--runs", "1"];
    let said = work.done(&line);
    let lines: Vec<_> = said.stdout.lines().collect();
    assert_eq!(lines.len(), 3, "{lines:?}");
    assert!(lines[0].starts_with("scene") && lines[0].ends_with("left out"), "{}", lines[0]);
    assert!(lines[1].starts_with("ball   psm auto"), "{}", lines[1]);
}
