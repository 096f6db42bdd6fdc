//! Progress and warnings on standard error: a bar on a terminal, lines otherwise, nothing when quiet.

use std::io::IsTerminal;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use vitreo_uq::inference::ensemble::{Phase, Progress};
use vitreo_uq::workflow::Monitor;

/// Time between two lines about the sampler where there is no terminal.
const LINE_INTERVAL_S: f64 = 5.0;
/// Time between two pictures of the bar, so that its clock runs where a stage has nothing to count.
const TICK: Duration = Duration::from_millis(120);

/// The user's terminal.
pub struct Terminal {
    quiet: bool,
    bar: Option<ProgressBar>,
    /// The stage, as long as nothing else is said of it.
    stage: Mutex<String>,
    last_line: Mutex<Instant>,
    stop: Arc<AtomicBool>,
}

impl Terminal {
    /// Watches for Ctrl-C too: the first asks the job to stop at the next safe place, the second ends the program.
    pub fn new(quiet: bool) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&stop);
        let handler = ctrlc::set_handler(move || {
            if flag.swap(true, Ordering::SeqCst) {
                std::process::exit(130);
            }
            eprintln!("\nstopping at the next safe place (Ctrl-C again to stop at once) …");
        });
        let bar = (!quiet && std::io::stderr().is_terminal()).then(|| {
            let style = ProgressStyle::with_template("{spinner} {msg} {wide_bar} {elapsed}")
                .unwrap_or_else(|_| ProgressStyle::default_bar());
            let bar = ProgressBar::new(1).with_style(style);
            bar.enable_steady_tick(TICK);
            bar
        });
        let terminal = Self { quiet, bar, stage: Mutex::default(), last_line: Mutex::new(Instant::now()), stop };
        if handler.is_err() {
            terminal.warn("Ctrl-C will end the program without keeping its state");
        }
        terminal
    }

    /// Ends the bar.
    pub fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
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
            None if !self.quiet => eprintln!("{text} …"),
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
        } else if !self.quiet
            && let Ok(mut last) = self.last_line.lock()
            && last.elapsed().as_secs_f64() > LINE_INTERVAL_S
        {
            *last = Instant::now();
            eprintln!("{text}");
        }
    }

    fn progress(&self, done: usize, most: usize) {
        if let (Some(bar), Ok(stage)) = (&self.bar, self.stage.lock()) {
            bar.set_length(most.max(1) as u64);
            bar.set_position(done as u64);
            bar.set_message(format!("{stage}: {done} of {most}"));
        }
    }

    fn warn(&self, text: &str) {
        let show = || eprintln!("note: {text}");
        match &self.bar {
            Some(bar) => bar.suspend(show),
            None if !self.quiet => show(),
            None => {}
        }
    }

    fn stop(&self) -> Option<&AtomicBool> {
        Some(&self.stop)
    }
}
