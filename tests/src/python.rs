//! Python packages that serve as references, each in an environment made here once with `pip`.

use std::ffi::OsStr;
use std::path::PathBuf;
use std::process::Command;
use std::sync::OnceLock;

use serde::de::DeserializeOwned;

use crate::cargo::{build_folder, repository, succeed};

/// A Python that has the packages of a reference.
#[derive(Debug)]
pub struct Environment {
    /// Folder of its scripts in `tests/`, and of its own among the builds.
    name: &'static str,
    packages: &'static [&'static str],
    /// Names a Python that has the packages already.
    variable: &'static str,
    made: OnceLock<Result<PathBuf, String>>,
}

impl Environment {
    /// Not made before it is used.
    pub const fn new(
        name: &'static str,
        packages: &'static [&'static str],
        variable: &'static str,
    ) -> Self {
        Self {
            name,
            packages,
            variable,
            made: OnceLock::new(),
        }
    }

    fn python(&self) -> Result<PathBuf, String> {
        if let Some(python) = std::env::var_os(self.variable) {
            return Ok(python.into());
        }
        // Tests run side by side: one makes it, the others wait.
        self.made.get_or_init(|| self.make()).clone()
    }

    fn make(&self) -> Result<PathBuf, String> {
        let folder = build_folder(self.name);
        let python = folder.join("bin/python");
        // An interrupted installation must not be taken for a whole one.
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

    /// What one of its scripts prints, read from JSON.
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

/// A reference's answer; where it cannot be had, a failure in CI and a plain word elsewhere.
///
/// # Panics
/// In CI, if there is none.
pub fn answer<T>(name: &str, answer: Result<T, String>) -> Option<T> {
    match answer {
        Ok(answer) => Some(answer),
        Err(error) if std::env::var_os("CI").is_some() => panic!("{error}"),
        Err(error) => {
            eprintln!("NOT TESTED against {name}: {error}");
            None
        }
    }
}
