//! Keeps the tree tidy: dependencies point one way, every source file says what it is for.

use std::fs;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Our own crates among the dependencies of a manifest, development ones left out.
fn own_dependencies(manifest: &str) -> Vec<String> {
    let text = fs::read_to_string(root().join(manifest)).expect("a manifest");
    let mut section = String::new();
    let mut found = Vec::new();
    for line in text.lines() {
        if let Some(name) = line.strip_prefix('[') {
            section = name.trim_end_matches(']').to_string();
        }
        let counts = section.ends_with("dependencies") && !section.contains("dev-") && !section.starts_with("workspace");
        if counts && line.starts_with("pmesh-") {
            found.push(line.split(['.', ' ', '=']).next().unwrap_or_default().to_string());
        }
    }
    found
}

#[test]
fn dependencies_point_one_way() {
    let allowed: [(&str, &[&str]); 8] = [
        ("crates/pmesh-core/Cargo.toml", &[]),
        ("crates/pmesh-codec/Cargo.toml", &["pmesh-core"]),
        ("crates/pmesh-build/Cargo.toml", &["pmesh-core", "pmesh-codec"]),
        ("crates/pmesh-view/Cargo.toml", &["pmesh-core", "pmesh-codec"]),
        ("crates/pmesh-server/Cargo.toml", &["pmesh-core", "pmesh-codec", "pmesh-build", "pmesh-view"]),
        ("crates/pmesh-cli/Cargo.toml", &["pmesh-core", "pmesh-codec", "pmesh-build", "pmesh-server", "pmesh-view"]),
        ("crates/pmesh-encoder/Cargo.toml", &["pmesh-codec", "pmesh-build"]),
        ("Cargo.toml", &["pmesh-core", "pmesh-codec", "pmesh-view"]),
    ];
    for (manifest, may) in allowed {
        let uses = own_dependencies(manifest);
        assert_eq!(uses.len(), may.len(), "{manifest}: {uses:?}");
        assert!(uses.iter().all(|d| may.contains(&d.as_str())), "{manifest}: {uses:?}");
    }
    let crates = fs::read_dir(root().join("crates")).expect("the crates").count();
    assert_eq!(crates + 1, allowed.len(), "a new crate is named here with what it may use");
}

fn sources(folder: &Path, out: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a folder").flatten() {
        let path = entry.path();
        if path.is_dir() {
            sources(&path, out);
        } else if path.extension().is_some_and(|e| e == "rs") {
            out.push(path);
        }
    }
}

#[test]
fn every_source_file_opens_with_what_lives_in_it_and_stays_readable() {
    let mut files = Vec::new();
    ["src", "crates", "xtask", "tests"].iter().for_each(|f| sources(&root().join(f), &mut files));
    assert!(files.len() > 60);
    for file in files {
        let text = fs::read_to_string(&file).expect("a source file");
        assert!(text.starts_with("//!"), "{}: no //! at its head", file.display());
        assert!(text.lines().count() <= 600, "{}: over 600 lines", file.display());
    }
}

#[test]
fn core_and_codecs_read_no_clock_file_socket_or_environment() {
    let mut files = Vec::new();
    ["crates/pmesh-core/src", "crates/pmesh-codec/src"].iter().for_each(|f| sources(&root().join(f), &mut files));
    for file in files {
        let text = fs::read_to_string(&file).expect("a source file");
        for word in ["std::time", "std::fs", "std::net", "std::env", "static mut", "thread_local"] {
            assert!(!text.contains(word), "{}: {word}", file.display());
        }
    }
}
