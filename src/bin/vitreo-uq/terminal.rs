//! Shows progress and warnings on standard error: a bar on a terminal, lines elsewhere, and nothing with `--quiet`.

use std::io::IsTerminal;
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use vitreo_uq::posterior::monitor::Monitor;
use vitreo_uq::sampling::ensemble::{Phase, Progress};

use crate::interrupt::{self, print_message};

/// Time between two lines on the sampler's progress if standard error is not a terminal, in s.
const LINE_INTERVAL_S: f64 = 5.0;
/// Time between two redraws of the bar. The bar's clock then advances even in stages without a count.
const TICK: Duration = Duration::from_millis(120);

/// Environment variable by which another program requests readable progress. If it is [`PROGRESS_IN_LINES`], progress is written as lines that begin with
/// [`PROGRESS`].
pub const PROGRESS_VARIABLE: &str = "VITREO_UQ_PROGRESS";
pub const PROGRESS_IN_LINES: &str = "lines";
pub const PROGRESS: &str = "progress: ";
/// Time between two lines of progress that another program reads, in s.
const PROGRESS_INTERVAL_S: f64 = 0.2;

/// Progress display of a command.
pub struct Terminal {
    quiet: bool,
    in_lines: bool,
    bar: Option<ProgressBar>,
    /// Name of the current stage. It is displayed beside counts.
    stage: Mutex<String>,
    last_line: Mutex<Instant>,
}

impl Terminal {
    /// Creates the display. It shows nothing if `quiet` is true.
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

    /// Ends the progress bar.
    pub fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

impl Terminal {
    fn say_progress(&self, done: u64, most: u64) {
        if self.is_line_due(PROGRESS_INTERVAL_S) {
            print_message(&format!("{PROGRESS}{done} of {most}"));
        }
    }

    /// Returns whether `interval_s` (s) has passed since the last line of progress, and restarts the interval if so. With `--quiet` the result is false.
    fn is_line_due(&self, interval_s: f64) -> bool {
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
            None if !self.quiet => print_message(&format!("{text} …")),
            None => {}
        }
    }

    fn sampling(&self, progress: &Progress) {
        let phase = match progress.phase {
            Phase::BurnIn => "burn-in",
            Phase::Sampling => "sampling",
        };
        let text =
            format!("{phase}: step {} of {}, at most {}", progress.steps, progress.next_check_step, progress.max_steps);
        if let Some(bar) = &self.bar {
            bar.set_length(progress.next_check_step.max(1));
            bar.set_position(progress.steps);
            bar.set_message(text);
        } else if self.in_lines {
            self.say_progress(progress.steps, progress.next_check_step);
        } else if self.is_line_due(LINE_INTERVAL_S) {
            print_message(&text);
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
        let show = || print_message(&format!("note: {text}"));
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
