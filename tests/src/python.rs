//! Python packages used as references, each in an environment created once with `pip`.

use std::ffi::OsStr;
use std::path::PathBuf;
use std::process::Command;
use std::sync::OnceLock;

use serde::de::DeserializeOwned;

use crate::cargo::{build_folder, repository, succeed};

/// A Python environment with the packages of a reference.
#[derive(Debug)]
pub struct Environment {
    /// Folder of its scripts in `tests/`, and of the environment among the builds.
    name: &'static str,
    packages: &'static [&'static str],
    /// Environment variable for a Python that has the packages already.
    variable: &'static str,
    created: OnceLock<Result<PathBuf, String>>,
}

impl Environment {
    /// Created on first use.
    pub const fn new(
        name: &'static str,
        packages: &'static [&'static str],
        variable: &'static str,
    ) -> Self {
        Self {
            name,
            packages,
            variable,
            created: OnceLock::new(),
        }
    }

    fn python(&self) -> Result<PathBuf, String> {
        if let Some(python) = std::env::var_os(self.variable) {
            return Ok(python.into());
        }
        // Tests run in parallel: one creates it, the others wait.
        self.created.get_or_init(|| self.make()).clone()
    }

    fn make(&self) -> Result<PathBuf, String> {
        let folder = build_folder(self.name);
        let python = folder.join("bin/python");
        // An interrupted installation must not be used.
        let complete = folder.join("complete");
        if complete.exists() {
            return Ok(python);
        }
        let make = || {
            let venv = ["-m", "venv", "--clear"];
            succeed(Command::new("python3").args(venv).arg(&folder))?;
            let pip = ["-m", "pip", "install", "--quiet", "--no-cache-dir"];
            succeed(Command::new(&python).args(pip).args(self.packages))?;
            std::fs::write(&complete, "")
                .map_err(|error| format!("{}: {error}", complete.display()))
        };
        make().map_err(|error| {
            let packages = self.packages.join(" ");
            format!(
                "{packages} could not be installed; run `pip install {packages}` and name that Python in {}.\n{error}",
                self.variable
            )
        })?;
        Ok(python)
    }

    /// Output of one of its scripts, parsed from JSON.
    pub fn run<T: DeserializeOwned>(
        &self,
        script: &str,
        arguments: &[impl AsRef<OsStr>],
    ) -> Result<T, String> {
        let mut command = Command::new(self.python()?);
        command
            .arg(repository().join("tests").join(self.name).join(script))
            .args(arguments);
        let output = command
            .output()
            .map_err(|error| format!("{command:?} did not start: {error}"))?;
        if !output.status.success() {
            return Err(format!(
                "{command:?} failed:\n{}",
                String::from_utf8_lossy(&output.stderr)
            ));
        }
        serde_json::from_slice(&output.stdout)
            .map_err(|error| format!("{command:?} printed something else than expected: {error}"))
    }
}

/// A reference's result; if unavailable, a failure in CI and a note elsewhere.
///
/// # Panics
/// In CI, if there is none.
pub fn require_in_ci<T>(name: &str, require_in_ci: Result<T, String>) -> Option<T> {
    match require_in_ci {
        Ok(require_in_ci) => Some(require_in_ci),
        Err(error) if std::env::var_os("CI").is_some() => panic!("{error}"),
        Err(error) => {
            eprintln!("NOT TESTED against {name}: {error}");
            None
        }
    }
}
