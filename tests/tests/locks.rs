//! Host and firmware are resolved apart, and yet compute with the same code.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use ins_tests::cargo::repository;
use serde::Deserialize;

#[derive(Deserialize)]
struct Lock {
    package: Vec<Package>,
}

#[derive(Deserialize)]
struct Package {
    name: String,
    version: String,
    #[serde(default)]
    dependencies: Vec<String>,
}

/// Packages that a package of a lock file leads to, and their versions.
fn closure(lock: &str, root: &str) -> Result<BTreeMap<String, BTreeSet<String>>, String> {
    let path = repository().join(lock);
    let explain = |error: &dyn std::fmt::Display| format!("{}: {error}", path.display());
    let text = fs::read_to_string(&path).map_err(|error| explain(&error))?;
    let lock: Lock = toml::from_str(&text).map_err(|error| explain(&error))?;
    let mut versions = BTreeMap::<String, BTreeSet<String>>::new();
    let mut open = vec![root.to_owned()];
    while let Some(reference) = open.pop() {
        // "name", or "name version" where there are several.
        let (name, version) = match reference.split_once(' ') {
            Some((name, version)) => (name, Some(version)),
            None => (reference.as_str(), None),
        };
        let package = lock
            .package
            .iter()
            .find(|p| p.name == name && version.is_none_or(|version| p.version == version))
            .ok_or_else(|| explain(&format!("no package {reference}")))?;
        let known = versions.entry(package.name.clone()).or_default();
        if known.insert(package.version.clone()) {
            open.extend(package.dependencies.iter().cloned());
        }
    }
    Ok(versions)
}

/// Of what the core computes with, and the link.
#[test]
fn firmware_and_host_have_the_same_versions() -> Result<(), String> {
    for root in ["ins-core", "ins-link"] {
        let host = closure("Cargo.lock", root)?;
        for lock in ["firmware-example/Cargo.lock", "tests/peers/Cargo.lock"] {
            let mut common = 0;
            for (name, versions) in closure(lock, root)? {
                // What only one side switches on is not in the other's.
                let Some(host) = host.get(&name) else {
                    continue;
                };
                assert_eq!(&versions, host, "{name} in {lock} and in Cargo.lock");
                common += 1;
            }
            assert!(common > 10, "{common} packages in common");
        }
        for name in ["nalgebra", "simba", "num-traits", "libm", "heapless"] {
            assert!(host.contains_key(name), "{name}");
        }
    }
    Ok(())
}
