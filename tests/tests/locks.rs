//! Host and firmware have separate lock files with the same versions of shared packages.

use std::collections::BTreeMap;
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
    /// "name", or "name version" where there are several.
    #[serde(default)]
    dependencies: Vec<String>,
}

impl Lock {
    fn read(name: &str) -> Result<Self, String> {
        let explain = |error: &dyn std::fmt::Display| format!("{name}: {error}");
        let text = fs::read_to_string(repository().join(name)).map_err(|error| explain(&error))?;
        toml::from_str(&text).map_err(|error| explain(&error))
    }

    fn package(&self, reference: &str) -> Option<&Package> {
        self.package.iter().find(|package| {
            reference == package.name
                || reference == format!("{} {}", package.name, package.version)
        })
    }

    /// What a package depends on, by name.
    fn dependencies(&self, package: &Package) -> BTreeMap<&str, &Package> {
        let packages = package.dependencies.iter();
        packages
            .filter_map(|reference| self.package(reference))
            .map(|package| (package.name.as_str(), package))
            .collect()
    }
}

/// Direct and indirect dependencies of a package in both lock files, with both versions.
fn common_versions<'a>(
    one: &'a Lock,
    other: &'a Lock,
    root: &str,
) -> Option<BTreeMap<&'a str, [&'a str; 2]>> {
    let mut open = vec![(one.package(root)?, other.package(root)?)];
    let mut versions = BTreeMap::new();
    while let Some((a, b)) = open.pop() {
        if versions
            .insert(a.name.as_str(), [a.version.as_str(), b.version.as_str()])
            .is_none()
        {
            let others = other.dependencies(b);
            let dependencies = one.dependencies(a).into_iter();
            open.extend(dependencies.filter_map(|(name, a)| Some((a, *others.get(name)?))));
        }
    }
    Some(versions)
}

#[test]
fn host_and_targets_have_the_same_versions() -> Result<(), String> {
    let host = Lock::read("Cargo.lock")?;
    for name in ["firmware-example/Cargo.lock", "tests/peers/Cargo.lock"] {
        let target = Lock::read(name)?;
        let versions = common_versions(&host, &target, "ins-link").ok_or("no ins-link")?;
        for needed in [
            "ins-core",
            "nalgebra",
            "simba",
            "num-traits",
            "libm",
            "heapless",
        ] {
            assert!(versions.contains_key(needed), "{needed}: {versions:?}");
        }
        for (package, [on_host, on_target]) in versions {
            assert_eq!(on_host, on_target, "{package}, in Cargo.lock and in {name}");
        }
    }
    Ok(())
}
