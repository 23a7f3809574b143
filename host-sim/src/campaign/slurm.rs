//! The job array for Slurm.

use std::env;
use std::path::{Path, PathBuf};

use miette::{IntoDiagnostic, Result};

use crate::page::output::replace;

/// Writes a script for `sbatch` into the folder: the command of this process in `jobs` shards, each on
/// all cores that it is given; then `sum`, or the command itself, adds them up.
pub fn write(name: &str, folder: &Path, jobs: u32, sum: Option<&[String]>) -> Result<PathBuf> {
    let command = this_command();
    let [shard, sum] = [&command[..], sum.unwrap_or(&command)].map(quoted);
    let here = env::current_dir().into_diagnostic()?.display().to_string();
    let file = folder.join(format!("{name}.sbatch"));
    let text = format!(
        "#!/bin/bash\n\
         #SBATCH --job-name={name}\n\
         #SBATCH --array=1-{jobs}\n\
         #SBATCH --requeue\n\
         # A job that is stopped goes on where it was when it runs again. Submit, then add up:\n\
         #   job=$(sbatch --parsable {name}.sbatch)\n\
         #   sbatch --dependency=afterok:$job --array=0 {name}.sbatch\n\
         set -euo pipefail\n\
         cd {here}\n\
         export RAYON_NUM_THREADS=\"${{SLURM_CPUS_PER_TASK:-1}}\"\n\
         program=\"${{HOST_SIM:-host-sim}}\"\n\
         if [ \"$SLURM_ARRAY_TASK_ID\" = 0 ]; then\n\
         \x20   exec \"$program\" {sum}\n\
         fi\n\
         exec \"$program\" {shard} \\\n\
         \x20   --shard \"$SLURM_ARRAY_TASK_ID/{jobs}\"\n",
        here = quoted(&[here]),
    );
    replace(&file, &text)?;
    Ok(file)
}

/// Arguments of this process, without `--slurm` and `--force`.
fn this_command() -> Vec<String> {
    let mut words = env::args_os()
        .skip(1)
        .map(|word| word.to_string_lossy().into_owned());
    let mut command = Vec::new();
    while let Some(word) = words.next() {
        if word == "--slurm" {
            words.next();
        } else if word != "--force" && !word.starts_with("--slurm=") {
            command.push(word);
        }
    }
    command
}

/// Quoted for a shell; fails only on nul, which no argument has.
fn quoted(words: &[String]) -> String {
    let words = words.iter().map(String::as_str);
    shlex::try_join(words).unwrap_or_default()
}
