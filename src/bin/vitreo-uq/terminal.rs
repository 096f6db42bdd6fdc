//! Progress and warnings on standard error: a bar on a terminal, lines otherwise, nothing when quiet.

use std::io::IsTerminal;
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use vitreo_uq::posterior::monitor::Monitor;
use vitreo_uq::sampling::ensemble::{Phase, Progress};

use crate::interrupt::{self, say};

/// Time between two lines about the sampler where there is no terminal.
const LINE_INTERVAL_S: f64 = 5.0;
/// Time between two pictures of the bar, so that its clock runs where a stage has nothing to count.
const TICK: Duration = Duration::from_millis(120);

/// Set to [`PROGRESS_IN_LINES`] by a program that reads this one's words: what a bar would show is then said in lines that begin with [`PROGRESS`].
pub const PROGRESS_VARIABLE: &str = "VITREO_UQ_PROGRESS";
pub const PROGRESS_IN_LINES: &str = "lines";
pub const PROGRESS: &str = "progress: ";
/// Time between two such lines.
const PROGRESS_INTERVAL_S: f64 = 0.2;

/// The user's terminal.
pub struct Terminal {
    quiet: bool,
    in_lines: bool,
    bar: Option<ProgressBar>,
    /// The stage, as long as nothing else is said of it.
    stage: Mutex<String>,
    last_line: Mutex<Instant>,
}

impl Terminal {
    /// Says what a job does, or nothing of it.
    pub fn new(quiet: bool) -> Self {
        let bar = (!quiet && std::io::stderr().is_terminal()).then(|| {
            let style = ProgressStyle::with_template("{spinner} {msg} {wide_bar} {elapsed}")
                .unwrap_or_else(|_| ProgressStyle::default_bar());
            let bar = ProgressBar::new(1).with_style(style);
            bar.enable_steady_tick(TICK);
            bar
        });
        bar.iter().for_each(interrupt::clear_at_end);
        let in_lines = std::env::var_os(PROGRESS_VARIABLE).is_some_and(|value| value == PROGRESS_IN_LINES);
        Self { quiet, in_lines, bar, stage: Mutex::default(), last_line: Mutex::new(Instant::now()) }
    }

    /// Ends the bar.
    pub fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

impl Terminal {
    fn say_progress(&self, done: u64, most: u64) {
        if self.may_speak(PROGRESS_INTERVAL_S) {
            say(&format!("{PROGRESS}{done} of {most}"));
        }
    }

    /// Whether a line may be said that comes again and again.
    fn may_speak(&self, interval_s: f64) -> bool {
        let Ok(mut last) = self.last_line.lock() else { return false };
        let is_due = !self.quiet && last.elapsed().as_secs_f64() > interval_s;
        if is_due {
            *last = Instant::now();
        }
        is_due
    }
}

impl Monitor for Terminal {
    fn stage(&self, text: &str) {
        match &self.bar {
            Some(bar) => {
                bar.set_length(1);
                bar.set_position(0);
                bar.set_message(text.to_string());
                if let Ok(mut stage) = self.stage.lock() {
                    *stage = text.to_string();
                }
            }
            None if !self.quiet => say(&format!("{text} …")),
            None => {}
        }
    }

    fn sampling(&self, progress: &Progress) {
        let phase = match progress.phase {
            Phase::BurnIn => "burn-in",
            Phase::Sampling => "sampling",
        };
        let text =
            format!("{phase}: step {} of {}, at most {}", progress.steps, progress.next_judgement, progress.max_steps);
        if let Some(bar) = &self.bar {
            bar.set_length(progress.next_judgement.max(1));
            bar.set_position(progress.steps);
            bar.set_message(text);
        } else if self.in_lines {
            self.say_progress(progress.steps, progress.next_judgement);
        } else if self.may_speak(LINE_INTERVAL_S) {
            say(&text);
        }
    }

    fn progress(&self, done: usize, most: usize) {
        if let (Some(bar), Ok(stage)) = (&self.bar, self.stage.lock()) {
            bar.set_length(most.max(1) as u64);
            bar.set_position(done as u64);
            bar.set_message(format!("{stage}: {done} of {most}"));
        } else if self.in_lines {
            self.say_progress(done as u64, most as u64);
        }
    }

    fn warn(&self, text: &str) {
        let show = || say(&format!("note: {text}"));
        match &self.bar {
            Some(bar) => bar.suspend(show),
            None if !self.quiet => show(),
            None => {}
        }
    }

    fn stop(&self) -> Option<&AtomicBool> {
        Some(interrupt::flag())
    }
}
