//! Dependencies point one way: the table of crates in ARCHITECTURE, checked against what `cargo metadata` says.

#![expect(clippy::unwrap_used, reason = "a test ends where something is missing")]

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

use serde_json::Value;

/// What each crate of the workspace may use of the others.
const ARROWS: &[(&str, &[&str])] = &[
    ("splat_core", &[]),
    ("splat_shaders", &[]),
    ("splat_io", &["splat_core"]),
    ("splat_raster", &["splat_core", "splat_shaders"]),
    ("splat_segment", &["splat_core", "splat_raster"]),
    ("splat_models", &["splat_core", "splat_segment"]),
    ("splat_physics", &["splat_core"]),
    ("splat_edit", &["splat_core", "splat_raster"]),
    ("bevy_splat", ENGINE_FREE),
    ("bevy_splat_ui", &["bevy_splat"]),
    ("splat", PROGRAM),
];

const ENGINE_FREE: &[&str] = &[
    "splat_core",
    "splat_shaders",
    "splat_io",
    "splat_raster",
    "splat_segment",
    "splat_models",
    "splat_physics",
    "splat_edit",
];

/// The engine-free ones; the window only by a feature, so that a build without it has no engine.
const PROGRAM: &[&str] = &[
    "splat_core",
    "splat_shaders",
    "splat_io",
    "splat_raster",
    "splat_segment",
    "splat_models",
    "splat_physics",
    "splat_edit",
    "bevy_splat_ui",
];

/// Heavy foreign crates and the only ones of ours that may use them (a name that ends in `*` stands for all that begin so).
const FOREIGN: &[(&str, &[&str])] = &[
    ("bevy*", &["bevy_splat", "bevy_splat_ui"]),
    ("egui*", &["bevy_splat_ui"]),
    ("wgpu*", &["splat_raster", "bevy_splat"]),
    ("ort", &["splat_models"]),
    ("clap*", &["splat"]),
    ("indicatif", &["splat"]),
];

/// A sentence for each arrow that should not be there.
fn wrong_arrows(metadata: &Value) -> Vec<String> {
    let packages = metadata["packages"].as_array().unwrap();
    let name = |v: &Value| v["name"].as_str().unwrap().to_owned();
    let ours: BTreeSet<String> = packages.iter().map(name).collect();
    let mut uses: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    let mut wrong = Vec::new();
    for package in packages {
        let from = name(package);
        let allowed = ARROWS.iter().find(|(crate_name, _)| *crate_name == from).map(|(_, allowed)| *allowed);
        let Some(allowed) = allowed else {
            wrong.push(format!("{from} is not in the table of crates"));
            continue;
        };
        for dependency in package["dependencies"].as_array().unwrap() {
            let to = name(dependency);
            // Tests may use more: what matters for them comes below.
            if dependency["kind"] == "dev" {
                continue;
            }
            if ours.contains(&to) {
                uses.entry(from.clone()).or_default().insert(to.clone());
                if !allowed.contains(&to.as_str()) {
                    wrong.push(format!("{from} must not use {to}"));
                }
                if from == "splat" && to.starts_with("bevy") && dependency["optional"] != true {
                    wrong.push(format!("{from} may use {to} only by a feature"));
                }
                continue;
            }
            for (foreign, users) in FOREIGN {
                let meant = foreign.strip_suffix('*').map_or(to == *foreign, |begin| to.starts_with(begin));
                if meant && !users.contains(&from.as_str()) {
                    wrong.push(format!("{from} must not use {to}; {} may", users.join(", ")));
                }
            }
        }
    }
    // A test that uses what uses it would build the crate twice, as two different crates.
    for package in packages {
        let from = name(package);
        for dependency in package["dependencies"].as_array().unwrap() {
            let to = name(dependency);
            if dependency["kind"] == "dev" && reaches(&uses, &to, &from) {
                wrong.push(format!("the tests of {from} must not use {to}, which uses {from}"));
            }
        }
    }
    wrong
}

fn reaches(uses: &BTreeMap<String, BTreeSet<String>>, from: &str, to: &str) -> bool {
    uses.get(from).is_some_and(|next| next.contains(to) || next.iter().any(|n| reaches(uses, n, to)))
}

#[test]
fn dependencies_point_down_the_table_only() {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--no-deps", "--offline"])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(metadata["packages"].as_array().unwrap().len() > 4);
    let wrong = wrong_arrows(&metadata);
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn an_arrow_that_points_up_is_found() {
    let package = |name: &str, dependencies: Value| serde_json::json!({ "name": name, "dependencies": dependencies });
    let needs = |name: &str| serde_json::json!({ "name": name, "kind": null, "optional": false });
    let tests_need = |name: &str| serde_json::json!({ "name": name, "kind": "dev", "optional": false });
    let check = |packages: Vec<Value>| wrong_arrows(&serde_json::json!({ "packages": packages }));

    let io = || package("splat_io", serde_json::json!([needs("splat_core"), needs("zstd")]));
    let core = |d: Value| package("splat_core", d);
    assert!(check(vec![io(), core(serde_json::json!([]))]).is_empty());
    assert_eq!(check(vec![io(), core(serde_json::json!([needs("splat_io")]))]), ["splat_core must not use splat_io"]);
    assert_eq!(check(vec![core(serde_json::json!([needs("bevy_math")]))]).len(), 1);
    assert_eq!(check(vec![io(), core(serde_json::json!([tests_need("splat_io")]))]).len(), 1);
    assert_eq!(check(vec![package("splat_new", serde_json::json!([]))]), ["splat_new is not in the table of crates"]);
}
