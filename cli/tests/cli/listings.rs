//! `techniques` and `scenes`: for people and for programs, from the same source.

use crate::workbench::Workbench;

#[test]
fn techniques_tell_their_settings() {
    let bench = Workbench::new();
    let text = bench.done(&["techniques"]).stdout;
    let list = bench.done(&["techniques", "--json"]).json();
    let list = list["techniques"].as_array().unwrap();
    assert!(list.iter().any(|technique| technique["name"] == "shadow-map"));
    for technique in list {
        assert!(text.contains(technique["summary"].as_str().unwrap()));
        let settings = technique["settings"].as_array().unwrap();
        for setting in settings {
            assert!(!setting["default"].is_null(), "{setting}");
            assert!(text.contains(setting["doc"].as_str().unwrap()), "{setting}");
        }
        let takes = technique["takes"].as_object().unwrap();
        assert!(takes.values().any(|answer| answer["support"] != "unsupported"));
        assert!(takes.values().all(|answer| answer["support"] == "exact" || answer["why"].is_string()));
        let variants = technique["variants"].as_array().unwrap();
        let choices = settings.iter().find(|setting| setting["name"] == "variant");
        let choices = choices.map_or(1, |setting| setting["range"].as_array().unwrap().len());
        assert_eq!(variants.len(), choices);
        assert!(variants.iter().all(|variant| variant["takes"].as_object().unwrap().len() == takes.len()));
        let presets = technique["presets"].as_object().unwrap();
        assert_eq!(presets.len(), technique["preset_order"].as_array().unwrap().len());
        assert!(presets.values().all(|preset| preset.as_object().unwrap().len() == settings.len()));
    }
    let one = bench.done(&["techniques", "shadow-map", "--json"]).json();
    assert_eq!(one["techniques"].as_array().unwrap().len(), 1);
}

#[test]
fn every_scene_that_is_listed_can_be_built_with_its_parameters() {
    let bench = Workbench::new();
    let text = bench.done(&["scenes"]).stdout;
    let list = bench.done(&["scenes", "--json"]).json();
    for scene in list["scenes"].as_array().unwrap() {
        let name = scene["name"].as_str().unwrap();
        assert!(text.contains(scene["summary"].as_str().unwrap()));
        let parameters = scene["parameters"].as_array().unwrap();
        let settings: Vec<String> =
            parameters.iter().map(|p| format!("{}={}", p["name"].as_str().unwrap(), p["default"])).collect();
        let spec = format!("{name}:{}", settings.join(","));
        bench.done(&["reference", &spec, "--size", "4x4", "--samples", "2", "--out", "out"]);
    }
}
