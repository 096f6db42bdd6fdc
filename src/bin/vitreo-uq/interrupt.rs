//! Handles signals. Every command ends within a second after a signal, leaves no file half-written, and prints how to continue.
//!
//! The first signal asks the job to stop. The sampler stops at its next step and saves its state. A job inside a long operation, such as a factorisation,
//! cannot react, so the program ends after half a second without waiting for it. All files are written through [`vitreo_uq::base::files`], which leaves either
//! the old content or the new.

use std::io::Write;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock, mpsc};
use std::time::{Duration, Instant};

use indicatif::ProgressBar;
use signal_hook::consts::{SIGINT, SIGTERM};
use vitreo_uq::base::files::stop_writing;

/// Time between two checks whether a signal has arrived.
const LOOK: Duration = Duration::from_millis(20);
/// Times for three successive steps, together less than a second. During `GRACE` the job stops by itself. During `LAST_STEPS` the program completes groups of
/// files that belong together. During `LAST_WORD` the terminal prints the last message.
const GRACE: Duration = Duration::from_millis(500);
const LAST_STEPS: Duration = Duration::from_millis(250);
const LAST_WORD: Duration = Duration::from_millis(100);
/// Time within which a command that this program has started must end. It includes the three times above.
const CHILDREN_GRACE: Duration = Duration::from_millis(900);
/// Number that shells add to the number of a signal to get the exit code.
const SIGNAL_BASE: usize = 128;

static STOP: AtomicBool = AtomicBool::new(false);
/// True once the program is ending. It is set before the first file is removed, while the job still runs.
static ENDING: AtomicBool = AtomicBool::new(false);
/// Process group of the command that this program has started; 0 if there is none.
static CHILDREN: AtomicU32 = AtomicU32::new(0);
static BAR: OnceLock<ProgressBar> = OnceLock::new();
static SIGNAL: OnceLock<Arc<AtomicUsize>> = OnceLock::new();

/// Starts a thread that watches for Ctrl-C, termination and a closed terminal. If one of them ends the program, the thread prints `how_to_go_on`.
pub fn watch(how_to_go_on: &'static str) {
    let signal = SIGNAL.get_or_init(Arc::default);
    let watched = signals().into_iter().filter(|signal_number| {
        signal_hook::flag::register_usize(
            *signal_number,
            Arc::clone(signal),
            usize::try_from(*signal_number).unwrap_or_default(),
        )
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
        // A terminal that is stopped or closed may block a thread that writes to it, so another thread writes.
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

/// Blocks for ever if a signal is ending the program; otherwise returns at once. The ending removes temporary files, so a job's error at this time is
/// misleading and must not be reported.
pub fn block_while_ending() {
    while ENDING.load(Ordering::SeqCst) {
        std::thread::park();
    }
}

/// Returns whether a signal that ends the program has arrived.
pub fn is_signalled() -> bool {
    signal() != 0
}

/// Sets the process group that a signal ends before it ends this program. `process` is the first process of the group. Call this function with 0 after the
/// group has ended.
pub fn set_child_group(process: u32) {
    CHILDREN.store(process, Ordering::SeqCst);
}

/// Urgency with which a process group must end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Urgency {
    /// Asks the processes to end, so that they can finish their files.
    Ask,
    /// Kills the processes immediately.
    Kill,
}

/// Gives the job time to stop. If the job is a separate command, waits for it, and kills it if it takes too long.
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

/// Sends a signal to the process group of a command that this program has started. `process` is the first process of the group.
#[cfg(any(target_os = "linux", target_vendor = "apple"))]
pub fn end_group(process: u32, urgency: Urgency) {
    use rustix::process::{Pid, Signal, kill_process_group};
    let signal = if urgency == Urgency::Ask { Signal::TERM } else { Signal::KILL };
    if let Some(pid) = i32::try_from(process).ok().and_then(Pid::from_raw) {
        // An error is ignored, because the group may have ended already.
        let _ = kill_process_group(pid, signal);
    }
}

#[cfg(not(any(target_os = "linux", target_vendor = "apple")))]
pub fn end_group(process: u32, _: Urgency) {
    let _ = std::process::Command::new("taskkill").args(["/T", "/F", "/PID", &process.to_string()]).status();
}

/// Flag that is true when the job should stop.
pub fn flag() -> &'static AtomicBool {
    &STOP
}

/// Registers a progress bar, which is cleared before the last message.
pub fn clear_at_end(bar: &ProgressBar) {
    let _ = BAR.set(bar.clone());
}

/// Exit code of a program that a signal has stopped: 130 for Ctrl-C, 143 for termination, 129 for a closed terminal.
pub fn exit_code() -> u8 {
    let signal = match signal() {
        0 => usize::try_from(SIGINT).unwrap_or_default(),
        signal => signal,
    };
    u8::try_from(SIGNAL_BASE + signal).unwrap_or(u8::MAX)
}

/// Message of a program that a signal has stopped. It ends with `how_to_go_on`.
pub fn stop_message(how_to_go_on: &str) -> String {
    let by = if signal() == usize::try_from(SIGINT).unwrap_or_default() { "Ctrl-C" } else { "a signal" };
    format!("stopped by {by}; finished results are kept, and no file is half-written\n  what to do: {how_to_go_on}")
}

/// Prints one line on standard error. Errors are ignored, because a closed terminal or pipe must not end the job.
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

/// Numbers of the signals to watch. Hang-up is not watched if the process ignores it, as `nohup` requests.
#[cfg(unix)]
fn signals() -> Vec<i32> {
    use signal_hook::consts::SIGHUP;
    if is_ignored(SIGHUP) { vec![SIGINT, SIGTERM] } else { vec![SIGINT, SIGTERM, SIGHUP] }
}

/// Returns whether the process ignores a signal. Only Linux reports this; on other systems the result is false.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| u64::from_str_radix(line.strip_prefix("SigIgn:")?.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}
