//! Scripts that submit a list to a scheduler of a cluster: HyperQueue, or Slurm with a job array.
//!
//! The scheduler calls the program with the number of a part of the list. The program runs those tasks of the part that have no result yet. The script
//! can therefore be submitted again at any time.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use super::list::{List, absolute};
use base::error::{Error, InputPlace, Result, Setting};
use base::files::{create_folders, file_error, write_atomically};

/// Scheduler that starts the workers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Engine {
    /// HyperQueue, see <https://it4innovations.github.io/hyperqueue>.
    HyperQueue,
    /// Slurm, see <https://slurm.schedmd.com>.
    Slurm,
}

/// Resources that the scheduler reserves for each part of the list.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Resources {
    /// Number of processor cores, each of which runs one worker.
    pub cores: usize,
    /// Time limit in minutes.
    pub minutes: u64,
    /// Memory for all workers of the part, in MiB.
    pub memory_mib: u64,
}

/// Largest number of parts by default. Slurm accepts 1,000 elements per job array in its default configuration.
const MOST_PARTS: usize = 1_000;

/// Range of the task numbers in part `part` of a list that is divided into `parts` parts. Every task belongs to exactly one part.
///
/// # Errors
/// [`Error::Input`] if there is no such part.
pub fn tasks_of_part(n_tasks: usize, part: usize, parts: usize) -> Result<std::ops::Range<usize>> {
    if part >= parts {
        let found = format!("part {part} of {parts}");
        return Err(Error::input(InputPlace::setting(Setting::Part), found, "count parts from 0: `0/10` to `9/10`"));
    }
    // Numbers of tasks and parts are at most millions, so their product cannot overflow.
    Ok(part * n_tasks / parts..(part + 1) * n_tasks / parts)
}

/// Number of parts into which a list is divided: the requested number, or a default.
///
/// # Errors
/// [`Error::Input`] if zero parts are requested.
pub fn n_parts(n_tasks: usize, asked_for: Option<usize>) -> Result<usize> {
    match asked_for {
        Some(0) => Err(Error::input(InputPlace::setting(Setting::Parts), "no parts", "give a positive number")),
        Some(parts) => Ok(parts.min(n_tasks)),
        None => Ok(n_tasks.min(MOST_PARTS)),
    }
}

/// Writes the submission script into the list's directory and makes a folder for the workers' logs. Returns the script's path.
///
/// # Errors
/// [`Error::Input`] for resources of zero, [`Error::File`] if the file system refuses.
pub fn write(list: &List, program: &Path, engine: Engine, resources: Resources, parts: usize) -> Result<PathBuf> {
    let Resources { cores, minutes, memory_mib } = resources;
    for (setting, value) in [(Setting::Cores, cores as u64), (Setting::Minutes, minutes), (Setting::Memory, memory_mib)]
    {
        if value == 0 {
            return Err(Error::input(InputPlace::setting(setting), "0", "give a positive number"));
        }
    }
    let dir = absolute(list.dir())?;
    let logs = dir.join("logs");
    create_folders(&logs, "make the list's directory writable")?;
    let name = match engine {
        Engine::HyperQueue => "submit-hq.sh",
        Engine::Slurm => "submit-slurm.sh",
    };
    let path = dir.join(name);
    let text = match engine {
        Engine::HyperQueue => hyper_queue(&dir, &logs, program, resources, parts),
        Engine::Slurm => slurm(&dir, &logs, program, resources, parts),
    };
    write_atomically(&path, text.as_bytes())?;
    executable(&path)?;
    Ok(path)
}

fn hyper_queue(dir: &Path, logs: &Path, program: &Path, resources: Resources, parts: usize) -> String {
    let Resources { cores, minutes, memory_mib } = resources;
    let run = format!(
        "exec {} tasks run {} --part \"$HQ_TASK_ID/{parts}\" --jobs {cores} --quiet",
        quoted(program),
        quoted(dir)
    );
    let mut text = String::from(
        "#!/usr/bin/env bash\n# Submits the list to HyperQueue. It can be run again: parts with complete results end at once.\n",
    );
    let log = quoted(&logs.join("hq-%{TASK_ID}.txt"));
    let _ = write!(
        text,
        "set -euo pipefail\nexec hq submit --name vitreo-uq --array 0-{} --cpus {cores} --resource mem={memory_mib} \\\n    --time-limit {minutes}m --crash-limit 3 --stdout {log} --stderr {log} \\\n    -- bash -c {}\n",
        parts - 1,
        quoted_text(&run)
    );
    text
}

fn slurm(dir: &Path, logs: &Path, program: &Path, resources: Resources, parts: usize) -> String {
    let Resources { cores, minutes, memory_mib } = resources;
    let mut text = String::from(
        "#!/usr/bin/env bash\n# Submits the list to Slurm: sbatch submit-slurm.sh. It can be submitted again: parts with complete results end at once.\n",
    );
    let _ = write!(
        text,
        "#SBATCH --job-name=vitreo-uq\n#SBATCH --array=0-{}\n#SBATCH --cpus-per-task={cores}\n#SBATCH --mem={memory_mib}M\n#SBATCH --time={minutes}\n#SBATCH --requeue\n#SBATCH --output=\"{}\"\nexec {} tasks run {} --part \"$SLURM_ARRAY_TASK_ID/{parts}\" --jobs {cores} --quiet\n",
        parts - 1,
        logs.join("slurm-%A_%a.txt").display(),
        quoted(program),
        quoted(dir)
    );
    text
}

/// Quotes a path so that a shell reads it as one word.
fn quoted(path: &Path) -> String {
    quoted_text(&path.display().to_string())
}

fn quoted_text(text: &str) -> String {
    format!("'{}'", text.replace('\'', r"'\''"))
}

#[cfg(unix)]
fn executable(path: &Path) -> Result<()> {
    use std::os::unix::fs::PermissionsExt;
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o755)).map_err(file_error("make executable", path))
}

#[cfg(not(unix))]
fn executable(_path: &Path) -> Result<()> {
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each task belongs to exactly one part, for several numbers of tasks and parts.
    #[test]
    fn parts_are_the_whole() {
        for n_tasks in [1, 2, 7, 300, 100_001] {
            for parts in [1, 2, 3, 7, 1_000] {
                let all = (0..parts).flat_map(|part| tasks_of_part(n_tasks, part, parts).unwrap());
                assert!(all.eq(0..n_tasks), "{n_tasks} in {parts}");
            }
        }
        assert!(tasks_of_part(10, 10, 10).is_err_and(|error| error.to_string().contains("`part`: part 10 of 10")));
        assert_eq!((n_parts(300, None).unwrap(), n_parts(100_000, None).unwrap()), (300, 1_000));
    }

    #[test]
    fn words_of_a_shell_keep_their_quotes() {
        assert_eq!(quoted(Path::new("/it's here/a b")), r"'/it'\''s here/a b'");
    }
}
