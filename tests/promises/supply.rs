//! What the project depends on, and under which terms: deny.toml's lists of licences and sources, checked without a network.

use serde_json::Value;
use std::path::Path;
use std::process::Command;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The strings of a list in deny.toml.
fn list(name: &str) -> Vec<String> {
    let text = std::fs::read_to_string(root().join("deny.toml")).expect("deny.toml");
    let start = text.find(&format!("\n{name} = [")).expect("a list of this name");
    let text = &text[start..];
    let words = text[..text.find(']').expect("an end")].split('"').skip(1).step_by(2);
    words.map(str::to_owned).collect()
}

/// Whether a licence expression can be met by those allowed: names, `AND`, `OR` (once written `/`), `WITH` and parentheses.
fn is_met(expression: &str, allowed: &[String]) -> bool {
    fn any<'a>(words: &mut std::iter::Peekable<impl Iterator<Item = &'a str>>, allowed: &[String]) -> bool {
        let mut met = all(words, allowed);
        while words.next_if_eq(&"OR").is_some() {
            met |= all(words, allowed);
        }
        met
    }
    fn all<'a>(words: &mut std::iter::Peekable<impl Iterator<Item = &'a str>>, allowed: &[String]) -> bool {
        let mut met = one(words, allowed);
        while words.next_if_eq(&"AND").is_some() {
            met &= one(words, allowed);
        }
        met
    }
    fn one<'a>(words: &mut std::iter::Peekable<impl Iterator<Item = &'a str>>, allowed: &[String]) -> bool {
        let Some(word) = words.next() else { return false };
        if word == "(" {
            let met = any(words, allowed);
            return words.next() == Some(")") && met;
        }
        let name = match words.next_if_eq(&"WITH").and_then(|_| words.next()) {
            Some(exception) => format!("{word} WITH {exception}"),
            None => word.to_owned(),
        };
        allowed.contains(&name)
    }
    let spaced = expression.replace('/', " OR ").replace('(', " ( ").replace(')', " ) ");
    let mut words = spaced.split_whitespace().peekable();
    any(&mut words, allowed) && words.next().is_none()
}

#[test]
fn expressions_are_understood() {
    let allowed = ["MIT", "Zlib", "Apache-2.0 WITH LLVM-exception"].map(str::to_owned);
    for met in ["MIT", "GPL-3.0 OR MIT", "MIT/GPL-3.0", "(GPL-3.0 OR MIT) AND Zlib", "Apache-2.0 WITH LLVM-exception"] {
        assert!(is_met(met, &allowed), "{met}");
    }
    for not in ["", "GPL-3.0", "MIT AND GPL-3.0", "Apache-2.0", "(MIT OR Zlib", "MIT GPL-3.0"] {
        assert!(!is_met(not, &allowed), "{not}");
    }
}

#[test]
fn dependencies_are_under_terms_that_are_allowed() {
    let (licences, registries) = (list("allow"), list("allow-registry"));
    assert!(licences.len() > 3 && registries.len() == 1, "{licences:?} {registries:?}");
    let run = |args: &[&str]| Command::new(env!("CARGO")).current_dir(root()).args(args).output().expect("cargo");
    let version = String::from_utf8(run(&["--version", "--verbose"]).stdout).expect("text");
    let host = version.lines().find_map(|line| line.strip_prefix("host: ")).expect("a host");
    // What other systems need was never fetched here.
    let output = run(&["metadata", "--format-version=1", "--offline", "--all-features", "--filter-platform", host]);
    if !output.status.success() {
        println!("skipped: {}", String::from_utf8_lossy(&output.stderr));
        return;
    }
    let metadata: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let packages = metadata["packages"].as_array().expect("a list");
    assert!(packages.len() > 50, "{}", packages.len());
    for package in packages.iter().filter(|package| !package["source"].is_null()) {
        let (name, source) = (&package["name"], package["source"].as_str().expect("a source"));
        assert!(
            registries.iter().any(|registry| source == format!("registry+{registry}")),
            "{name} comes from {source}"
        );
        let licence = package["license"].as_str().unwrap_or("");
        assert!(is_met(licence, &licences), "{name} is under \"{licence}\"");
    }
}

#[test]
fn the_library_forbids_what_is_unsafe() {
    let manifest = std::fs::read_to_string(root().join("Cargo.toml")).expect("a manifest");
    assert!(manifest.contains("unsafe_code = \"forbid\"") && manifest.contains("rust-version = "));
    let library = std::fs::read_to_string(root().join("src/lib.rs")).expect("a library");
    assert!(library.contains("#![forbid(unsafe_code)]"));
}
