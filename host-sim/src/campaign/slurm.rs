//! The job array for Slurm.

use std::path::Path;

/// A script for `sbatch`: as many shards as jobs, each on all cores that it is given.
pub fn script(plan: &Path, out: &Path, jobs: u32) -> String {
    let [plan, out] = [plan, out].map(|path| quoted(&path.display().to_string()));
    format!(
        "#!/bin/bash\n\
         #SBATCH --job-name=campaign\n\
         #SBATCH --array=1-{jobs}\n\
         #SBATCH --requeue\n\
         # A job that is stopped goes on where it was when it runs again. Submit, then add up:\n\
         #   job=$(sbatch --parsable campaign.sbatch)\n\
         #   sbatch --dependency=afterok:$job --wrap \"host-sim merge {out}\"\n\
         set -euo pipefail\n\
         export RAYON_NUM_THREADS=\"${{SLURM_CPUS_PER_TASK:-1}}\"\n\
         exec \"${{HOST_SIM:-host-sim}}\" campaign {plan} --out {out} \\\n\
         \x20 --shard \"$SLURM_ARRAY_TASK_ID/{jobs}\"\n"
    )
}

/// For a shell, whatever is in it.
fn quoted(text: &str) -> String {
    format!("'{}'", text.replace('\'', "'\\''"))
}
