//! Help, in snapshots: what a user reads first.

use crate::workbench::Workbench;

fn help(arguments: &[&str]) -> String {
    Workbench::new().done(arguments).stdout
}

#[test]
fn of_the_command() {
    insta::assert_snapshot!(help(&["--help"]));
}

#[test]
fn of_compare() {
    insta::assert_snapshot!(help(&["compare", "--help"]));
}

#[test]
fn of_render() {
    insta::assert_snapshot!(help(&["render", "--help"]));
}

#[test]
fn of_bake() {
    insta::assert_snapshot!(help(&["bake", "--help"]));
}

#[test]
fn of_reference() {
    insta::assert_snapshot!(help(&["reference", "--help"]));
}

#[test]
fn of_techniques() {
    insta::assert_snapshot!(help(&["techniques", "--help"]));
}

#[test]
fn of_scenes() {
    insta::assert_snapshot!(help(&["scenes", "--help"]));
}

#[test]
fn without_arguments_help_is_a_fault() {
    let said = Workbench::new().run(&[]);
    assert_eq!((said.code, said.stdout.as_str()), (2, ""));
    assert!(said.stderr.contains("Usage: gnomon") && said.stderr.contains("Examples:"));
}

#[test]
fn version() {
    assert_eq!(help(&["--version"]), format!("gnomon {}\n", env!("CARGO_PKG_VERSION")));
}
