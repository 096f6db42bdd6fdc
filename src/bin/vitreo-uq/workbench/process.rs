//! Identifies the process of a job. The system may give its number to another process later.

use std::process::{Child, Command};

use serde::{Deserialize, Serialize};

use crate::interrupt::{self, Urgency};

/// Environment variable of a job's process. It contains the token of the job.
const TOKEN: &str = "VITREO_UQ_JOB";

/// A process, identified by its number, its start time and an unguessable token. The number alone is insufficient: the system reuses numbers, and a list of
/// jobs from another person may contain any number.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Process {
    number: u32,
    /// Start time in the form in which the system reports it; empty if it is unknown.
    started: String,
    token: String,
}

impl Process {
    /// Starts a command as the first process of a new process group. [`Process::stop`] ends this group.
    pub fn spawn(command: &mut Command, token: String) -> std::io::Result<(Child, Self)> {
        command.env(TOKEN, &token);
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(command, 0);
        let child = command.spawn()?;
        let number = child.id();
        Ok((child, Self { number, started: system::start_of(number).unwrap_or_default(), token }))
    }

    /// Number of the process and also of its process group; 0 if no process has been started.
    pub fn number(&self) -> u32 {
        self.number
    }

    /// Returns whether the process runs. Another process with its number does not count.
    pub fn is_running(&self) -> bool {
        !self.token.is_empty()
            && !self.started.is_empty()
            && system::start_of(self.number).as_ref() == Some(&self.started)
            && system::has_in_environment(self.number, &format!("{TOKEN}={}", self.token))
    }

    /// Asks the process and its children to end, if the process runs.
    pub fn stop(&self) {
        if self.is_running() {
            interrupt::end_group(self.number, Urgency::Ask);
        }
    }
}

/// Asks a child process and its own children to end. Nobody may have waited for the child before.
pub fn stop_child(child: &Child) {
    interrupt::end_group(child.id(), Urgency::Ask);
}

#[cfg(target_os = "linux")]
mod system {
    /// Index of the start time among the fields that follow the process's name (`man 5 proc_pid_stat`).
    const START: usize = 19;

    /// Start time of a process, in clock ticks since the system's start. `None` if the process does not exist, or has ended without being waited for.
    pub fn start_of(number: u32) -> Option<String> {
        let text = std::fs::read_to_string(format!("/proc/{number}/stat")).ok()?;
        // The process's name is in parentheses and may contain any characters, so the last parenthesis is sought.
        let mut fields = text.rsplit_once(')')?.1.split_whitespace();
        let state = fields.next()?;
        (!["Z", "X"].contains(&state)).then_some(())?;
        fields.nth(START - 1).map(String::from)
    }

    /// Returns whether a process was started with this environment variable. If its environment cannot be read, it belongs to another user, and the result is
    /// false.
    pub fn has_in_environment(number: u32, variable: &str) -> bool {
        let bytes = std::fs::read(format!("/proc/{number}/environ")).unwrap_or_default();
        bytes.split(|byte| *byte == 0).any(|assignment| assignment == variable.as_bytes())
    }
}

#[cfg(target_vendor = "apple")]
mod system {
    fn told(number: u32, arguments: &[&str]) -> Option<String> {
        let output = std::process::Command::new("/bin/ps").args(arguments).args(["-p", &number.to_string()]).output();
        let text = String::from_utf8_lossy(&output.ok()?.stdout).trim().to_string();
        (!text.is_empty()).then_some(text)
    }

    /// Start time of a process, to the second; `None` if the process does not exist.
    pub fn start_of(number: u32) -> Option<String> {
        told(number, &["-o", "lstart="])
    }

    /// Returns whether a process was started with this environment variable.
    pub fn has_in_environment(number: u32, variable: &str) -> bool {
        told(number, &["-E", "-ww", "-o", "command="]).is_some_and(|text| text.split(' ').any(|own| own == variable))
    }
}

/// On other systems the workbench does not recognise the process of an earlier workbench.
#[cfg(not(any(target_os = "linux", target_vendor = "apple")))]
mod system {
    pub fn start_of(_: u32) -> Option<String> {
        None
    }

    pub fn has_in_environment(_: u32, _: &str) -> bool {
        false
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    /// Starts a process that sleeps, and waits until the system shows its environment. This takes a moment.
    fn sleeping(token: &str) -> (Child, Process) {
        let (child, process) = Process::spawn(Command::new("sleep").arg("60"), token.into()).unwrap();
        let began = std::time::Instant::now();
        while !process.is_running() {
            assert!(began.elapsed() < std::time::Duration::from_secs(10), "{process:?} is not known");
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        (child, process)
    }

    #[test]
    fn only_the_process_itself_is_known_and_stopped() {
        let (mut child, process) = sleeping("0a1b");
        let (mut other, of_other) = sleeping("ffff");
        // If one field differs, it is another process.
        for foreign in [
            Process { number: of_other.number, ..process.clone() },
            Process { number: of_other.number, started: of_other.started.clone(), token: "0a1b".into() },
            Process { token: String::new(), ..of_other.clone() },
            Process { token: "0a1".into(), ..process.clone() },
            Process { started: "1".into(), ..process.clone() },
            Process { number: std::process::id(), ..process.clone() },
            Process { number: 0, ..process.clone() },
            Process { number: u32::MAX, ..process.clone() },
        ] {
            assert!(!foreign.is_running(), "{foreign:?}");
            foreign.stop();
        }
        assert!(child.try_wait().unwrap().is_none() && other.try_wait().unwrap().is_none());
        process.stop();
        assert!(!child.wait().unwrap().success());
        assert!(!process.is_running() && of_other.is_running());
        stop_child(&other);
        assert!(!other.wait().unwrap().success());
    }

    /// A stop ends a shell and its children. It does not end other processes, such as those in the process group of the tests.
    #[test]
    fn a_stop_ends_the_group_alone() {
        let mut command = Command::new("sh");
        command.args(["-c", "sleep 60 & echo $!; wait"]).stdout(std::process::Stdio::piped());
        let (mut child, process) = Process::spawn(&mut command, "0a1b".into()).unwrap();
        let mut line = String::new();
        std::io::BufRead::read_line(&mut std::io::BufReader::new(child.stdout.take().unwrap()), &mut line).unwrap();
        let inner: u32 = line.trim().parse().unwrap();
        assert!(system::start_of(inner).is_some());
        process.stop();
        child.wait().unwrap();
        let began = std::time::Instant::now();
        while system::start_of(inner).is_some() {
            assert!(began.elapsed() < std::time::Duration::from_secs(10), "what it had started goes on");
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
    }
}
