//! Signals: any command ends within a second, leaves nothing half-written and says how to go on.
//!
//! The first signal asks the job to stop, which the sampler does at its next step, its state saved. A job in the middle of something long, such as a
//! factorisation, does not hear that: after a moment the program ends over its head. Whatever it writes goes through
//! [`vitreo_uq::base::files`], which leaves the old content or the new.

use std::io::Write;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock, mpsc};
use std::time::{Duration, Instant};

use indicatif::ProgressBar;
use signal_hook::consts::{SIGINT, SIGTERM};
use vitreo_uq::base::files::stop_writing;

/// Time between two looks whether a signal has come.
const LOOK: Duration = Duration::from_millis(20);
/// Time that a job has to stop by itself, then that steps have which belong together, then that the terminal has for a last word: less than a
/// second together.
const GRACE: Duration = Duration::from_millis(500);
const LAST_STEPS: Duration = Duration::from_millis(250);
const LAST_WORD: Duration = Duration::from_millis(100);
/// Time that a command which this program has started has to end, with all of the above.
const CHILDREN_GRACE: Duration = Duration::from_millis(900);
/// What shells add to a signal's number.
const SIGNAL_BASE: usize = 128;

static STOP: AtomicBool = AtomicBool::new(false);
/// Set before the first file is taken away from a job that goes on.
static ENDING: AtomicBool = AtomicBool::new(false);
/// The process group of the command that this program has started; 0 for none.
static CHILDREN: AtomicU32 = AtomicU32::new(0);
static BAR: OnceLock<ProgressBar> = OnceLock::new();
static SIGNAL: OnceLock<Arc<AtomicUsize>> = OnceLock::new();

/// Watches for Ctrl-C, for termination and for the terminal hanging up; `how_to_go_on` is said when the program ends by one of them.
pub fn watch(how_to_go_on: &'static str) {
    let signal = SIGNAL.get_or_init(Arc::default);
    let watched = signals().into_iter().filter(|own| {
        signal_hook::flag::register_usize(*own, Arc::clone(signal), usize::try_from(*own).unwrap_or_default()).is_ok()
    });
    if watched.count() == 0 {
        return say("note: Ctrl-C will end the program at once");
    }
    std::thread::spawn(move || {
        while signal.load(Ordering::SeqCst) == 0 {
            std::thread::sleep(LOOK);
        }
        STOP.store(true, Ordering::SeqCst);
        end_children();
        ENDING.store(true, Ordering::SeqCst);
        stop_writing(LAST_STEPS);
        // A terminal that is stopped or gone may keep whoever writes to it waiting.
        let (said, heard) = mpsc::channel();
        std::thread::spawn(move || {
            if let Some(bar) = BAR.get() {
                bar.finish_and_clear();
            }
            say(&last_word(how_to_go_on));
            let _ = said.send(());
        });
        let _ = heard.recv_timeout(LAST_WORD);
        std::process::exit(i32::from(exit_code()));
    });
}

/// Returns only if nothing is ending the program over its job's head: a job that fails then fails because its files are gone, which is no news.
pub fn wait_for_an_end_under_way() {
    while ENDING.load(Ordering::SeqCst) {
        std::thread::park();
    }
}

/// Whether a signal has come that ends the program.
pub fn has_come() -> bool {
    signal() != 0
}

/// From now on the program ends this process group before itself, where a signal ends it; 0 when the group has ended and that is written down. The group is that of its first process.
pub fn owns_group(process: u32) {
    CHILDREN.store(process, Ordering::SeqCst);
}

/// How a process group is ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Urgency {
    /// It has a second to leave nothing half-written.
    Ask,
    /// At once.
    Kill,
}

/// Gives the job of this program its time to stop; where that is a command of its own, sees to its end.
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

/// Ends the process group of a command that this program has started.
#[cfg(any(target_os = "linux", target_vendor = "apple"))]
pub fn end_group(process: u32, urgency: Urgency) {
    use rustix::process::{Pid, Signal, kill_process_group};
    let signal = if urgency == Urgency::Ask { Signal::TERM } else { Signal::KILL };
    if let Some(pid) = i32::try_from(process).ok().and_then(Pid::from_raw) {
        // One that has ended is no longer there to be ended.
        let _ = kill_process_group(pid, signal);
    }
}

#[cfg(not(any(target_os = "linux", target_vendor = "apple")))]
pub fn end_group(process: u32, _: Urgency) {
    let _ = std::process::Command::new("taskkill").args(["/T", "/F", "/PID", &process.to_string()]).status();
}

/// Set when the job should stop.
pub fn flag() -> &'static AtomicBool {
    &STOP
}

/// The bar that is to be taken off the terminal before the last word.
pub fn clear_at_end(bar: &ProgressBar) {
    let _ = BAR.set(bar.clone());
}

/// What a stopped program ends with: 130 for Ctrl-C, 143 for termination, 129 for a terminal that hung up.
pub fn exit_code() -> u8 {
    let signal = match signal() {
        0 => usize::try_from(SIGINT).unwrap_or_default(),
        signal => signal,
    };
    u8::try_from(SIGNAL_BASE + signal).unwrap_or(u8::MAX)
}

/// What a stopped program says.
pub fn last_word(how_to_go_on: &str) -> String {
    let by = if signal() == usize::try_from(SIGINT).unwrap_or_default() { "Ctrl-C" } else { "a signal" };
    format!("stopped by {by}; nothing is half-written, and what was finished is kept\n  what to do: {how_to_go_on}")
}

/// One line on standard error. A terminal that is gone or a closed pipe must not end a job.
pub fn say(text: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{text}");
}

fn signal() -> usize {
    SIGNAL.get().map_or(0, |signal| signal.load(Ordering::SeqCst))
}

#[cfg(not(unix))]
fn signals() -> Vec<i32> {
    vec![SIGINT, SIGTERM]
}

/// Hanging up is left alone where it is ignored: `nohup` asks for that.
#[cfg(unix)]
fn signals() -> Vec<i32> {
    use signal_hook::consts::SIGHUP;
    if is_ignored(SIGHUP) { vec![SIGINT, SIGTERM] } else { vec![SIGINT, SIGTERM, SIGHUP] }
}

/// As Linux tells; elsewhere nothing is ignored.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| u64::from_str_radix(line.strip_prefix("SigIgn:")?.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}
