//! Runs tasks on this machine with many workers, each in its own process. If a worker dies, only its task is interrupted; the task is then tried again.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use super::worker::WorkerAnswer;
use base::Result;
use posterior::monitor::{Counter, Monitor, refuse_if_stopped};

/// Number of attempts after which a failing task is given up.
const MOST_ATTEMPTS: usize = 3;
/// Number of consecutive failures after which no further task is started. The disk may be full, for example.
const MOST_IN_A_ROW: usize = 12;
/// Time between two checks for new tasks or a stop.
const LOOK: Duration = Duration::from_millis(20);

/// Result of running tasks.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct LocalOutcome {
    /// Number of tasks that this run completed.
    pub done: usize,
    /// Number of tasks whose result existed before this run.
    pub before: usize,
    /// Number of workers that died.
    pub worker_deaths: usize,
    /// Failed tasks: number of the task and its last message.
    pub failed: Vec<(usize, String)>,
    /// Tasks that were not started or not repeated, because too many consecutive tasks failed.
    pub left: Vec<usize>,
    /// Message of the last failure; `None` if a later task succeeded.
    pub last_failure: Option<String>,
}

/// Runs tasks in `jobs` processes, which `worker` starts. Each process receives task numbers on its standard input ([`super::worker::serve`]).
///
/// # Errors
/// [`base::Error::Interrupted`] when stopped; results that were written are kept.
pub fn run(
    tasks: &[usize],
    jobs: usize,
    worker: &(dyn Fn() -> Command + Sync),
    monitor: &dyn Monitor,
) -> Result<LocalOutcome> {
    let jobs = jobs.clamp(1, tasks.len().max(1));
    let shared = SharedQueue {
        queue: Mutex::new(Queue { waiting: tasks.iter().map(|task| (*task, 0)).collect(), under_way: 0, in_a_row: 0 }),
        outcome: Mutex::default(),
        processes: (0..jobs).map(|_| Mutex::new(None)).collect(),
        counter: Counter::new(monitor, tasks.len()),
        monitor,
    };
    let ended = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        for slot in &shared.processes {
            let (shared, ended) = (&shared, &ended);
            scope.spawn(move || {
                shared.work(slot, worker);
                ended.fetch_add(1, Ordering::SeqCst);
            });
        }
        // A thread that waits for its worker's answer cannot notice a stop. This loop therefore watches for a stop and kills the workers.
        while ended.load(Ordering::SeqCst) < jobs {
            if shared.is_stopped() {
                shared.processes.iter().for_each(kill);
            }
            std::thread::sleep(LOOK);
        }
    });
    refuse_if_stopped(monitor, "written results are kept")?;
    let mut outcome = locked(&shared.outcome).clone();
    outcome.left = locked(&shared.queue).waiting.iter().map(|(task, _)| *task).collect();
    outcome.left.sort_unstable();
    outcome.failed.sort();
    Ok(outcome)
}

struct Queue {
    /// Waiting tasks: number of the task, and number of earlier attempts.
    waiting: VecDeque<(usize, usize)>,
    under_way: usize,
    in_a_row: usize,
}

type Slot = Mutex<Option<Child>>;

struct SharedQueue<'a> {
    queue: Mutex<Queue>,
    outcome: Mutex<LocalOutcome>,
    /// Worker process of each thread. A stop kills all these processes.
    processes: Vec<Slot>,
    counter: Counter<'a>,
    monitor: &'a dyn Monitor,
}

impl SharedQueue<'_> {
    fn is_stopped(&self) -> bool {
        self.monitor.stop().is_some_and(|stop| stop.load(Ordering::Relaxed))
    }

    /// Returns the next task with its number of earlier attempts; `None` if no further task will come. While the queue is empty and other tasks run, it
    /// waits, because a failed task returns to the queue.
    fn next(&self) -> Option<(usize, usize)> {
        loop {
            let mut queue = locked(&self.queue);
            if self.is_stopped() || queue.in_a_row >= MOST_IN_A_ROW {
                return None;
            }
            if let Some(next) = queue.waiting.pop_front() {
                queue.under_way += 1;
                return Some(next);
            }
            if queue.under_way == 0 {
                return None;
            }
            drop(queue);
            std::thread::sleep(LOOK);
        }
    }

    fn succeeded(&self, count: impl Fn(&mut LocalOutcome)) {
        let mut outcome = locked(&self.outcome);
        count(&mut outcome);
        outcome.last_failure = None;
        drop(outcome);
        let mut queue = locked(&self.queue);
        queue.under_way -= 1;
        queue.in_a_row = 0;
        self.counter.add_one();
    }

    /// Puts a failed task at the end of the queue. A task that failed too often, or for which another attempt cannot succeed, is recorded as failed
    /// instead.
    fn failed(&self, (task, attempts): (usize, usize), why: String, can_retry: bool) {
        if self.is_stopped() {
            return;
        }
        let mut queue = locked(&self.queue);
        queue.under_way -= 1;
        queue.in_a_row += usize::from(can_retry);
        locked(&self.outcome).last_failure = Some(why.clone());
        if can_retry && attempts + 1 < MOST_ATTEMPTS {
            self.monitor.warn(&format!("task {task} will be tried again: {why}"));
            queue.waiting.push_back((task, attempts + 1));
        } else {
            locked(&self.outcome).failed.push((task, why));
            self.counter.add_one();
        }
    }

    /// Work of one thread: sends tasks to a worker process, and starts a new process if the worker dies.
    fn work(&self, slot: &Slot, worker: &(dyn Fn() -> Command + Sync)) {
        let mut ends: Option<(ChildStdin, BufReader<ChildStdout>)> = None;
        while let Some(task) = self.next() {
            let opened = match ends.take() {
                Some(ends) => Ok(ends),
                None => start(slot, worker),
            };
            let (mut numbers, mut answers) = match opened {
                Ok(opened) => opened,
                Err(error) => {
                    self.failed(task, format!("no worker could be started: {error}"), true);
                    continue;
                }
            };
            let mut line = String::new();
            let told = writeln!(numbers, "{}", task.0).and_then(|()| numbers.flush());
            let heard = told.and_then(|()| answers.read_line(&mut line));
            match heard.ok().and_then(|_| serde_json::from_str(&line).ok()) {
                Some(answer) => {
                    ends = Some((numbers, answers));
                    match answer {
                        WorkerAnswer::Done => self.succeeded(|outcome| outcome.done += 1),
                        WorkerAnswer::Before => self.succeeded(|outcome| outcome.before += 1),
                        WorkerAnswer::Failed(why) => self.failed(task, why, true),
                        WorkerAnswer::Refused(why) => self.failed(task, why, false),
                    }
                }
                None => {
                    let how = end(slot);
                    if !self.is_stopped() {
                        locked(&self.outcome).worker_deaths += 1;
                    }
                    self.failed(task, format!("its worker died ({how})"), true);
                }
            }
        }
        // Closing the worker's standard input makes the worker end.
        drop(ends);
        end(slot);
    }
}

fn start(slot: &Slot, worker: &(dyn Fn() -> Command + Sync)) -> std::io::Result<(ChildStdin, BufReader<ChildStdout>)> {
    let mut child = worker().stdin(Stdio::piped()).stdout(Stdio::piped()).spawn()?;
    let ends = child.stdin.take().zip(child.stdout.take());
    *locked(slot) = Some(child);
    ends.map(|(numbers, answers)| (numbers, BufReader::new(answers)))
        .ok_or_else(|| std::io::Error::other("the process has no standard input or output"))
}

fn kill(slot: &Slot) {
    if let Some(child) = locked(slot).as_mut() {
        // A worker leads a process group. The commands that it runs belong to this group and are killed with it.
        #[cfg(any(target_os = "linux", target_vendor = "apple"))]
        if let Some(group) = i32::try_from(child.id()).ok().and_then(rustix::process::Pid::from_raw) {
            let _ = rustix::process::kill_process_group(group, rustix::process::Signal::KILL);
        }
        // An error means that the process has already ended, which is harmless.
        let _ = child.kill();
    }
}

/// Waits until the process of a slot ends, and describes its exit status. The slot is released between checks, so that a stop can kill the process.
fn end(slot: &Slot) -> String {
    loop {
        let mut held = locked(slot);
        let Some(child) = held.as_mut() else { return "the process did not exist".into() };
        match child.try_wait() {
            Ok(None) => {}
            Ok(Some(status)) => {
                *held = None;
                return status.to_string();
            }
            Err(error) => {
                *held = None;
                return error.to_string();
            }
        }
        drop(held);
        std::thread::sleep(LOOK / 10);
    }
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
