//! Signals: every command ends within a second, leaves no file half-written and prints how to continue.
//!
//! The first signal asks the job to stop. The sampler stops at its next step and saves its state. A job inside a long operation, such as a
//! factorisation, cannot react, so the program ends after a moment without it. All files are written through
//! [`vitreo_uq::base::files`], which leaves either the old content or the new.

use std::io::Write;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock, mpsc};
use std::time::{Duration, Instant};

use indicatif::ProgressBar;
use signal_hook::consts::{SIGINT, SIGTERM};
use vitreo_uq::base::files::stop_writing;

/// Time between two checks for a signal.
const LOOK: Duration = Duration::from_millis(20);
/// Times for three steps, together less than a second: the job stops by itself, steps that belong together finish, and the terminal prints the last
/// message.
const GRACE: Duration = Duration::from_millis(500);
const LAST_STEPS: Duration = Duration::from_millis(250);
const LAST_WORD: Duration = Duration::from_millis(100);
/// Time for a command that this program has started to end, including the times above.
const CHILDREN_GRACE: Duration = Duration::from_millis(900);
/// Number that shells add to a signal's number.
const SIGNAL_BASE: usize = 128;

static STOP: AtomicBool = AtomicBool::new(false);
/// Set before the first file is removed while the job still runs.
static ENDING: AtomicBool = AtomicBool::new(false);
/// Process group of the command that this program has started; 0 if there is none.
static CHILDREN: AtomicU32 = AtomicU32::new(0);
static BAR: OnceLock<ProgressBar> = OnceLock::new();
static SIGNAL: OnceLock<Arc<AtomicUsize>> = OnceLock::new();

/// Watches for Ctrl-C, termination and a closed terminal. The program prints `how_to_go_on` when one of them ends it.
pub fn watch(how_to_go_on: &'static str) {
    let signal = SIGNAL.get_or_init(Arc::default);
    let watched = signals().into_iter().filter(|index| {
        signal_hook::flag::register_usize(*index, Arc::clone(signal), usize::try_from(*index).unwrap_or_default())
            .is_ok()
    });
    if watched.count() == 0 {
        return print_message("note: Ctrl-C will end the program immediately");
    }
    std::thread::spawn(move || {
        while signal.load(Ordering::SeqCst) == 0 {
            std::thread::sleep(LOOK);
        }
        STOP.store(true, Ordering::SeqCst);
        end_children();
        ENDING.store(true, Ordering::SeqCst);
        stop_writing(LAST_STEPS);
        // A stopped or closed terminal may block a thread that writes to it.
        let (said, heard) = mpsc::channel();
        std::thread::spawn(move || {
            if let Some(bar) = BAR.get() {
                bar.finish_and_clear();
            }
            print_message(&stop_message(how_to_go_on));
            let _ = said.send(());
        });
        let _ = heard.recv_timeout(LAST_WORD);
        std::process::exit(i32::from(exit_code()));
    });
}

/// Blocks while a signal ends the program. A job that fails then fails because its files are removed, and its error is not reported.
pub fn block_while_ending() {
    while ENDING.load(Ordering::SeqCst) {
        std::thread::park();
    }
}

/// Returns whether a signal to end the program has arrived.
pub fn is_signalled() -> bool {
    signal() != 0
}

/// Sets the process group, named by its first process, that a signal ends before this program. Set 0 once the group has ended and this is recorded.
pub fn owns_group(process: u32) {
    CHILDREN.store(process, Ordering::SeqCst);
}

/// How to end a process group.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Urgency {
    /// Ask the processes to end, so that they can finish their files.
    Ask,
    /// Kill the processes immediately.
    Kill,
}

/// Gives the job time to stop. If the job is a separate command, waits for it and kills it if needed.
fn end_children() {
    let process = CHILDREN.load(Ordering::SeqCst);
    if process == 0 {
        return std::thread::sleep(GRACE);
    }
    end_group(process, Urgency::Ask);
    let began = Instant::now();
    while CHILDREN.load(Ordering::SeqCst) != 0 {
        if began.elapsed() > CHILDREN_GRACE {
            return end_group(CHILDREN.load(Ordering::SeqCst), Urgency::Kill);
        }
        std::thread::sleep(LOOK);
    }
}

/// Sends a signal to the process group of a command that this program has started.
#[cfg(any(target_os = "linux", target_vendor = "apple"))]
pub fn end_group(process: u32, urgency: Urgency) {
    use rustix::process::{Pid, Signal, kill_process_group};
    let signal = if urgency == Urgency::Ask { Signal::TERM } else { Signal::KILL };
    if let Some(pid) = i32::try_from(process).ok().and_then(Pid::from_raw) {
        // The group may have ended already.
        let _ = kill_process_group(pid, signal);
    }
}

#[cfg(not(any(target_os = "linux", target_vendor = "apple")))]
pub fn end_group(process: u32, _: Urgency) {
    let _ = std::process::Command::new("taskkill").args(["/T", "/F", "/PID", &process.to_string()]).status();
}

/// Flag that is set when the job should stop.
pub fn flag() -> &'static AtomicBool {
    &STOP
}

/// Registers the bar to clear before the last message.
pub fn clear_at_end(bar: &ProgressBar) {
    let _ = BAR.set(bar.clone());
}

/// Exit code of a stopped program: 130 for Ctrl-C, 143 for termination, 129 for a closed terminal.
pub fn exit_code() -> u8 {
    let signal = match signal() {
        0 => usize::try_from(SIGINT).unwrap_or_default(),
        signal => signal,
    };
    u8::try_from(SIGNAL_BASE + signal).unwrap_or(u8::MAX)
}

/// Message of a stopped program.
pub fn stop_message(how_to_go_on: &str) -> String {
    let by = if signal() == usize::try_from(SIGINT).unwrap_or_default() { "Ctrl-C" } else { "a signal" };
    format!("stopped by {by}; finished results are kept, and no file is half-written\n  what to do: {how_to_go_on}")
}

/// Prints one line on standard error. A closed terminal or pipe must not end the job.
pub fn print_message(text: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{text}");
}

fn signal() -> usize {
    SIGNAL.get().map_or(0, |signal| signal.load(Ordering::SeqCst))
}

#[cfg(not(unix))]
fn signals() -> Vec<i32> {
    vec![SIGINT, SIGTERM]
}

/// Hang-up is not watched if it is ignored, as `nohup` requests.
#[cfg(unix)]
fn signals() -> Vec<i32> {
    use signal_hook::consts::SIGHUP;
    if is_ignored(SIGHUP) { vec![SIGINT, SIGTERM] } else { vec![SIGINT, SIGTERM, SIGHUP] }
}

/// Returns whether the process ignores a signal, which only Linux reports.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| u64::from_str_radix(line.strip_prefix("SigIgn:")?.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}
