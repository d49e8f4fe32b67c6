//! What a package says of itself.

use serde_json::Value;

use crate::shell::{CheckError, cargo_output};

/// A crate that can be published.
#[derive(Clone, Debug, Default)]
pub(crate) struct Package {
    pub(crate) name: String,
    pub(crate) version: String,
    /// Fields that are there.
    pub(super) fields: Vec<&'static str>,
    /// Crates of this workspace that it depends on.
    pub(crate) sisters: Vec<String>,
    /// Those without a version: a registry would not know which.
    pub(super) unversioned: Vec<String>,
    pub(super) keywords: usize,
    /// Bench targets.
    pub(crate) benches: Vec<String>,
}

/// Fields that every package has.
const REQUIRED: [&str; 7] =
    ["description", "license", "repository", "readme", "rust_version", "keywords", "categories"];

impl Package {
    fn new(value: &Value) -> Self {
        let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
        let list = |key: &str| value[key].as_array().cloned().unwrap_or_default();
        let is_there = |field: &&'static str| match &value[*field] {
            Value::String(text) => !text.trim().is_empty(),
            Value::Array(items) => !items.is_empty(),
            _ => false,
        };
        let sisters: Vec<Value> =
            list("dependencies").into_iter().filter(|d| d["path"].is_string()).collect();
        let is_unversioned = |d: &&Value| d["kind"] != "dev" && d["req"] == "*";
        let is_bench =
            |t: &&Value| t["kind"].as_array().is_some_and(|kinds| kinds.iter().any(|k| k == "bench"));
        Self {
            name: text(&value["name"]),
            version: text(&value["version"]),
            fields: REQUIRED.into_iter().filter(is_there).collect(),
            unversioned: sisters.iter().filter(is_unversioned).map(|d| text(&d["name"])).collect(),
            sisters: sisters.iter().map(|d| text(&d["name"])).collect(),
            keywords: list("keywords").len(),
            benches: list("targets").iter().filter(is_bench).map(|t| text(&t["name"])).collect(),
        }
    }

    /// Name and version, the folder inside a package.
    pub(crate) fn folder(&self) -> String {
        format!("{}-{}", self.name, self.version)
    }

    /// What is missing or would be refused.
    pub(super) fn faults(&self) -> Vec<String> {
        let name = &self.name;
        let missing = REQUIRED.into_iter().filter(|field| !self.fields.contains(field));
        let mut faults: Vec<String> =
            missing.map(|field| format!("{name}: no {field} in its manifest")).collect();
        if self.keywords > 5 {
            faults.push(format!("{name}: {} keywords, a registry takes 5", self.keywords));
        }
        faults.extend(
            self.unversioned.iter().map(|sister| format!("{name}: depends on {sister} without a version")),
        );
        faults
    }
}

/// The workspace's crates that can be published.
pub(crate) fn packages() -> Result<Vec<Package>, CheckError> {
    let output = cargo_output(&["metadata", "--no-deps", "--format-version", "1"])?;
    let value: Value =
        serde_json::from_str(&output).map_err(|e| CheckError::Failed(format!("cargo metadata: {e}")))?;
    let packages = value["packages"].as_array().cloned().unwrap_or_default();
    Ok(publishable(&packages))
}

fn publishable(packages: &[Value]) -> Vec<Package> {
    packages.iter().filter(|package| package["publish"].is_null()).map(Package::new).collect()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn complete() -> Value {
        json!({
            "name": "a", "version": "1.0.0", "description": "d", "license": "MIT", "repository": "r", "readme": "README.md",
            "rust_version": "1.89", "keywords": ["k"], "categories": ["c"], "publish": null,
            "dependencies": [{ "name": "b", "path": "/b", "req": "^1", "kind": null }],
            "targets": [{ "name": "a", "kind": ["lib"] }, { "name": "s", "kind": ["bench"] }],
        })
    }

    #[test]
    fn complete_metadata_passes() {
        let package = Package::new(&complete());
        assert_eq!((package.faults(), package.folder()), (Vec::<String>::new(), "a-1.0.0".to_owned()));
        assert_eq!(package.benches, ["s"]);
    }

    #[test]
    fn each_missing_field_is_told() {
        for field in REQUIRED {
            for nothing in [Value::Null, json!("")] {
                let mut value = complete();
                value[field] = nothing;
                assert_eq!(Package::new(&value).faults().len(), 1, "{field}");
            }
        }
        let mut value = complete();
        value["keywords"] = json!(["1", "2", "3", "4", "5", "6"]);
        value["dependencies"][0]["req"] = json!("*");
        assert_eq!(Package::new(&value).faults().len(), 2);
    }

    #[test]
    fn only_what_is_published_is_packed() {
        let mut private = complete();
        private["publish"] = json!([]);
        assert_eq!(publishable(&[private, complete()]).len(), 1);
    }
}
