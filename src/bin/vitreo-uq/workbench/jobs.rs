//! Runs the jobs that the page requests. A job is a sequence of this program's commands, and each command is a process of its own.
//!
//! The results on disk are those of the command in a terminal. If Ctrl-C or another signal ends the workbench, its command ends too. If the workbench is
//! killed, its command continues, and a workbench that is started later watches it.

use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};
use tokio::sync::watch;
use vitreo_uq::base::error::{Error, InputPlace, Result, Setting};
use vitreo_uq::base::files::{self, Content};
use vitreo_uq::posterior::study::CORNER_NAME;

use super::home::{FOLDER_VARIABLE, GROUPS, Item, WorkbenchFolder};
use super::process::{Process, stop_child};
use crate::child::{absolute, words};
use crate::interrupt;

/// Time between two reads of a running command's output.
const POLL_INTERVAL: Duration = Duration::from_millis(150);
/// Time between two reads of the output while the workbench waits for the command to end.
const FINAL_POLL_INTERVAL: Duration = Duration::from_millis(20);
/// Number of bytes at the end of a command's output that are read.
const TAIL_BYTES: u64 = 16_384;
/// Maximum number of revisions whose posteriors one corner plot shows.
const MOST_OVERLAID: usize = 4;
const WRITABLE: &str = "make the folder writable";
/// Exit code of a command that has finished, but whose result cannot be trusted.
const EXIT_UNTRUSTED: i32 = 1;

/// Job that a page requests.
#[derive(Debug, Clone, Deserialize)]
pub struct JobRequest {
    /// Name of the item that the job works on; for a comparison of groups, the folder of its results.
    pub item: String,
    /// Kind of the job.
    pub kind: JobKind,
    /// Name of the revision to analyse or extend; `None` for the last.
    pub revision: Option<String>,
    /// Names of the effects to add; for a comparison of groups, the keys that define the groups; for several records, their names.
    #[serde(default)]
    pub with: Vec<String>,
}

/// Kinds of jobs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum JobKind {
    /// Samples the first model, and tests its residuals.
    Sample,
    /// Tests the residuals of a revision.
    Compare,
    /// Finds effects that a revision lacks.
    Diagnose,
    /// Learns a correction of the law from data.
    Learn,
    /// Adds effects as the next revision, tests its residuals, and compares the errors of all revisions.
    Extend,
    /// Adds the formula that `learn` wrote as the next revision.
    Adopt,
    /// Compares the experiments in the folder by species or region.
    Groups,
    /// Creates a sample record with a hidden effect.
    Example,
    /// Samples the first model of several records.
    SampleMany,
    /// Finds effects that the last models of several records lack.
    DiagnoseMany,
}

/// Status of a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum JobStatus {
    /// The job is running.
    Running,
    /// The job has finished.
    Done,
    /// The job was refused or failed.
    Failed,
    /// The user stopped the job.
    Stopped,
    /// The job was interrupted because the workbench ended. Finished results are kept.
    Broken,
}

/// A job that was started, with its status.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Job {
    /// Name of the item that the job works on.
    pub item: String,
    /// Kind of the job.
    pub kind: JobKind,
    /// Command lines of the job, each as a list of words.
    pub commands: Vec<Vec<String>>,
    /// Index in `commands` of the command that runs.
    pub at: usize,
    /// Process of the command that runs.
    pub process: Process,
    /// Time at which the job started, in seconds since 1970.
    pub began_s: u64,
    /// Status of the job.
    pub standing: JobStatus,
    /// Last line of the job's output, or the reason why it failed.
    pub words: String,
    /// Number of finished steps in the current stage, and total number of its steps; `None` if they are unknown.
    pub progress: Option<[u64; 2]>,
}

/// Runs one job at a time, because each command uses all cores.
pub struct Jobs {
    home: WorkbenchFolder,
    program: PathBuf,
    present: Mutex<Option<Job>>,
    /// Process that this workbench has started and not yet waited for. Until then the system cannot use its number for another process.
    child: Mutex<Option<Child>>,
    is_stopped: AtomicBool,
    news: watch::Sender<u64>,
}

impl Jobs {
    /// Creates the manager of jobs. It takes over the job of an earlier workbench, if one is still running. `news` notifies pages of changes.
    pub fn new(home: WorkbenchFolder, news: watch::Sender<u64>) -> Result<Arc<Self>> {
        let program = std::env::current_exe()
            .map_err(|error| Error::at_path("find", "the program", error, "run the program by its absolute path"))?;
        let left: Option<Job> = files::read_if_there(&home.own().join("job.json"), Content::Document)
            .and_then(|bytes| serde_json::from_slice(&bytes).ok());
        let jobs = Arc::new(Self {
            home,
            program,
            present: Mutex::new(left),
            child: Mutex::default(),
            is_stopped: AtomicBool::new(false),
            news,
        });
        if jobs.present().is_some_and(|job| job.standing == JobStatus::Running) {
            let entry = Arc::clone(&jobs);
            std::thread::spawn(move || entry.watch_inherited_job());
        }
        Ok(jobs)
    }

    /// The job that is running, otherwise the last job; `None` if there was no job.
    pub fn present(&self) -> Option<Job> {
        self.present.lock().ok()?.clone()
    }

    /// Refuses a change of `what` while a job runs.
    pub fn refuse_running(&self, what: &str) -> Result<()> {
        match self.present().filter(|job| job.standing == JobStatus::Running) {
            Some(other) => Err(Error::input(
                InputPlace::file(&other.item),
                format!("a job is running, which may read {what} that is changed"),
                "wait until it ends, or stop it",
            )),
            None => Ok(()),
        }
    }

    /// Starts the job that a page requests. `is_replaced` is true if the study belongs to another record; its first model is then made anew.
    pub fn start(self: &Arc<Self>, wish: &JobRequest, item: &Item, is_replaced: bool) -> Result<Job> {
        let members =
            if wish.kind == JobKind::Groups { self.home.experiments_with_keys(&wish.with) } else { Vec::new() };
        let commands = commands(self.home.dir(), wish, item, is_replaced, &members)?;
        self.start_commands(item.name.clone(), wish.kind, commands)
    }

    /// Starts a job of the same kind for several records, one after the other. `items` says for each whether its study belongs to another record.
    pub fn start_many(self: &Arc<Self>, kind: JobKind, items: &[(Item, bool)]) -> Result<Job> {
        let of_one = if kind == JobKind::SampleMany { JobKind::Sample } else { JobKind::Diagnose };
        let mut all = Vec::new();
        // A record without a model has nothing to diagnose.
        let is_ready = |item: &Item| kind == JobKind::SampleMany || !item.revisions.is_empty();
        let ready = || {
            items.iter().filter(|(item, is_replaced)| is_ready(item) && (kind == JobKind::SampleMany || !is_replaced))
        };
        for (item, is_replaced) in ready() {
            let wish = JobRequest { item: item.name.clone(), kind: of_one, revision: None, with: Vec::new() };
            all.extend(commands(self.home.dir(), &wish, item, *is_replaced, &[])?);
        }
        if all.is_empty() {
            let (found, remedy) = match items {
                [] => ("no record is marked", "mark records in the table"),
                _ => ("none of the marked records has a model", "fit them first"),
            };
            return Err(Error::input(InputPlace::file(self.home.dir()), found, remedy));
        }
        self.start_commands(format!("{} records", ready().count()), kind, all)
    }

    fn start_commands(self: &Arc<Self>, item: String, kind: JobKind, commands: Vec<Vec<String>>) -> Result<Job> {
        let began_s = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
        let job = Job {
            item,
            kind,
            commands,
            at: 0,
            process: Process::default(),
            began_s,
            standing: JobStatus::Running,
            words: "starting".into(),
            progress: None,
        };
        {
            let mut present = self.present.lock().map_err(|_| lost_jobs_error())?;
            if let Some(other) = present.as_ref().filter(|other| other.standing == JobStatus::Running) {
                return Err(Error::input(
                    InputPlace::file(&other.item),
                    "another job is running",
                    "wait until it ends, or stop it",
                ));
            }
            *present = Some(job.clone());
        }
        self.is_stopped.store(false, Ordering::SeqCst);
        let jobs = Arc::clone(self);
        std::thread::spawn(move || jobs.run(job.commands.len()));
        self.present().ok_or_else(lost_jobs_error)
    }

    /// Stops the job. The process has one second to finish its files.
    pub fn stop(&self) {
        self.is_stopped.store(true, Ordering::SeqCst);
        if let Some(child) = self.child().as_ref() {
            return stop_child(child);
        }
        if let Some(job) = self.present().filter(|job| job.standing == JobStatus::Running) {
            job.process.stop();
        }
    }

    fn child(&self) -> MutexGuard<'_, Option<Child>> {
        self.child.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn change(&self, how: impl FnOnce(&mut Job)) {
        let Ok(mut present) = self.present.lock() else { return };
        let Some(job) = present.as_mut() else { return };
        let before = job.clone();
        how(job);
        if *job == before {
            return;
        }
        let is_kept = job.standing != before.standing || job.process != before.process;
        let after = job.clone();
        drop(present);
        if is_kept {
            // Errors are ignored: if the job cannot be saved, only a later workbench does not know it.
            let _ = files::create_folders(&self.home.own(), WRITABLE);
            let _ = files::write_json_atomically(&self.home.own().join("job.json"), &after);
        }
        self.news.send_modify(|number| *number += 1);
    }

    fn end(&self, standing: JobStatus, words: String) {
        self.change(|job| {
            job.standing = standing;
            job.words = words;
            job.progress = None;
            job.process = Process::default();
        });
    }

    fn run(&self, n_commands: usize) {
        // One record that cannot be fitted does not keep the others from it.
        let is_many = self.present().is_some_and(|job| matches!(job.kind, JobKind::SampleMany | JobKind::DiagnoseMany));
        let mut failures = Vec::new();
        for at in 0..n_commands {
            self.change(|job| job.at = at);
            let arguments = self.present().map_or(Vec::new(), |job| job.commands[at].clone());
            let code = self.spawn(&arguments).and_then(|process| {
                // A signal that ends the workbench also ends this process group.
                interrupt::set_child_group(process.number());
                self.change(|job| job.process = process);
                self.watch()
            });
            let is_stopped = self.is_stopped.load(Ordering::SeqCst) || interrupt::is_signalled();
            if is_stopped {
                self.end(JobStatus::Stopped, "stopped; finished results are kept, and no file is half-written".into());
            }
            interrupt::set_child_group(0);
            if is_stopped {
                return;
            }
            match code {
                Ok(Some(0 | EXIT_UNTRUSTED)) => {}
                Ok(_) if is_many => failures.push(find_error_message(&self.tail())),
                Ok(_) => return self.end(JobStatus::Failed, find_error_message(&self.tail())),
                Err(error) => return self.end(JobStatus::Failed, error.to_string()),
            }
        }
        match failures.first() {
            Some(first) => {
                let n = failures.len();
                self.end(JobStatus::Failed, format!("{n} of {n_commands} commands failed. The first: {first}"));
            }
            None => self.end(JobStatus::Done, String::new()),
        }
    }

    fn spawn(&self, arguments: &[String]) -> Result<Process> {
        let path = self.home.own();
        files::create_folders(&path, WRITABLE)?;
        // The output goes to files instead of pipes. The command can then continue if the workbench is killed.
        let [out, log] = ["job.out", "job.log"].map(|name| files::create_or_replace(&path.join(name), WRITABLE));
        let mut command = Command::new(&self.program);
        command
            .args(arguments)
            .current_dir(self.home.dir())
            .env(crate::terminal::PROGRESS_VARIABLE, crate::terminal::PROGRESS_IN_LINES)
            .env(FOLDER_VARIABLE, self.home.dir())
            .stdin(Stdio::null())
            .stdout(out?)
            .stderr(log?);
        let token = super::token()?;
        // The lock is held while the process starts, so that a stop comes either before the start or after it.
        let mut child = self.child();
        let (started, process) = Process::spawn(&mut command, token)
            .map_err(|error| Error::at_path("start", &self.program, error, "reinstall the program"))?;
        if self.is_stopped.load(Ordering::SeqCst) {
            stop_child(child.insert(started));
        } else {
            *child = Some(started);
        }
        Ok(process)
    }

    /// Waits for the command to end, and passes on its output. Returns its exit code; `None` if it did not end by itself.
    fn watch(&self) -> Result<Option<i32>> {
        loop {
            {
                let mut held = self.child();
                let Some(child) = held.as_mut() else { return Ok(None) };
                let ended = child
                    .try_wait()
                    .map_err(|error| Error::at_path("wait for", &self.program, error, "start the workbench again"))?;
                if let Some(status) = ended {
                    *held = None;
                    return Ok(status.code());
                }
            }
            self.pass_on();
            std::thread::sleep(if interrupt::is_signalled() { FINAL_POLL_INTERVAL } else { POLL_INTERVAL });
        }
    }

    fn pass_on(&self) {
        let (words, progress) = last_message_and_progress(&self.tail());
        self.change(|job| {
            if let Some(words) = words {
                job.words = words;
            }
            job.progress = progress;
        });
    }

    /// Waits for a command that an earlier workbench has started. The commands that follow it are not started; the user must do that.
    fn watch_inherited_job(&self) {
        let Some(job) = self.present() else { return };
        if !job.process.is_running() {
            let words = "the workbench ended during this job; finished results are kept; start the job again";
            return self.end(JobStatus::Broken, words.into());
        }
        interrupt::set_child_group(job.process.number());
        while job.process.is_running() {
            self.pass_on();
            std::thread::sleep(if interrupt::is_signalled() { FINAL_POLL_INTERVAL } else { POLL_INTERVAL });
        }
        let tail = self.tail();
        let is_stopped = self.is_stopped.load(Ordering::SeqCst) || interrupt::is_signalled();
        match tail.lines().any(|line| line.starts_with("error: ")) {
            _ if is_stopped => self.end(JobStatus::Stopped, "stopped; no file is half-written".into()),
            true => self.end(JobStatus::Failed, find_error_message(&tail)),
            false => self.end(JobStatus::Done, String::new()),
        }
        interrupt::set_child_group(0);
    }

    /// Last bytes of the command's output, as text.
    fn tail(&self) -> String {
        let read = || -> std::io::Result<String> {
            let mut file = files::open_file(&self.home.own().join("job.log")).map_err(std::io::Error::other)?;
            let length = file.metadata()?.len();
            file.seek(SeekFrom::Start(length.saturating_sub(TAIL_BYTES)))?;
            let mut bytes = Vec::new();
            file.take(TAIL_BYTES).read_to_end(&mut bytes)?;
            Ok(String::from_utf8_lossy(&bytes).into_owned())
        };
        read().unwrap_or_default()
    }
}

fn lost_jobs_error() -> Error {
    Error::numerical("the workbench has lost its list of jobs", "start the workbench again")
}

/// Command lines of the job that `wish` requests. `home` is the workbench's folder. `members` are the experiments of a comparison of groups.
pub(super) fn commands(
    home: &Path,
    wish: &JobRequest,
    item: &Item,
    is_replaced: bool,
    members: &[PathBuf],
) -> Result<Vec<Vec<String>>> {
    let place = |inside: &Path| absolute(&home.join(inside));
    let study = place(&item.study)?;
    let named = || -> Result<&String> {
        let revision = wish.revision.as_ref().or(item.revisions.last());
        revision.filter(|name| item.revisions.contains(name)).ok_or_else(|| {
            let remedy = "fit the first model to the record";
            Error::input(InputPlace::file(&item.study), "this revision does not exist", remedy)
        })
    };
    let of_study = |command: &str| words(&[command], &[], std::slice::from_ref(&study));
    let of_revision = |command: &str, with: Option<String>| -> Result<Vec<String>> {
        let mut options = vec![("from", Some(named()?.clone()))];
        options.extend(with.map(|with| ("with", Some(with))));
        Ok(words(&[command], &options, std::slice::from_ref(&study)))
    };
    let extended = |with: String| -> Result<Vec<Vec<String>>> {
        Ok(vec![
            of_revision("extend", Some(with))?,
            of_study("compare"),
            of_study("ladder"),
            corner_command(home, item)?,
        ])
    };
    match wish.kind {
        JobKind::Sample => {
            let mut options: Vec<(&str, Option<String>)> = Vec::new();
            let target = match &item.experiment {
                Some(experiment) => {
                    options.push(("out", Some(study.clone())));
                    place(experiment)?
                }
                None => study.clone(),
            };
            options.extend(is_replaced.then_some(("force", None)));
            let compare = words(&["compare"], &[("from", Some("m0".into()))], std::slice::from_ref(&study));
            Ok(vec![words(&["sample"], &options, &[target]), compare])
        }
        JobKind::Compare => Ok(vec![of_revision("compare", None)?]),
        JobKind::Diagnose => Ok(vec![of_revision("diagnose", None)?]),
        JobKind::Learn => Ok(vec![of_revision("learn", None)?]),
        JobKind::Extend => {
            let is_letter = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
            let is_slug = |slug: &String| !slug.is_empty() && !slug.starts_with('-') && slug.chars().all(is_letter);
            if wish.with.is_empty() || !wish.with.iter().all(is_slug) {
                let remedy = "choose effects from the list";
                return Err(Error::input(
                    InputPlace::setting(Setting::Effects),
                    "these are not names of effects",
                    remedy,
                ));
            }
            extended(wish.with.join(","))
        }
        JobKind::SampleMany | JobKind::DiagnoseMany => Ok(Vec::new()),
        // A softening gel, whose loop from the table to the named effect takes a minute.
        JobKind::Example => {
            let options = [("effect", "softening"), ("strength", "30"), ("seed", "7")];
            let options = options.map(|(name, value)| (name, Some(value.to_string())));
            let out = [("out", Some(place(Path::new(&item.name))?))];
            Ok(vec![words(&["challenge", "new"], &[out.as_slice(), &options].concat(), &[])])
        }
        JobKind::Groups => {
            if wish.with.is_empty() || !wish.with.iter().all(|key| key == "species" || key == "region") {
                let remedy = "choose species, region, or both";
                return Err(Error::input(InputPlace::setting(Setting::By), "this is not a key for groups", remedy));
            }
            let options = [("by", Some(wish.with.join(","))), ("out", Some(place(Path::new(GROUPS))?))];
            // The comparison takes these paths as names of its experiments. Its results stay in its own folder.
            let members: Vec<String> = members.iter().map(|member| member.display().to_string()).collect();
            Ok(vec![words(&["groups"], &options, &members), of_study("report")])
        }
        JobKind::Adopt => {
            // The path is relative to the folder in which the command runs. An absolute path could contain a comma, which would divide the argument.
            let file = Path::new(".").join(&item.study).join(named()?).join(vitreo_uq::learning::FILE_NAME);
            let file = file.display().to_string();
            if file.contains(',') {
                return Err(Error::input(
                    InputPlace::file(&item.study),
                    "this name contains a comma",
                    "rename it without one",
                ));
            }
            extended(file)
        }
    }
}

/// Command line that draws a corner plot of the posteriors of the latest revisions and the next one.
fn corner_command(home: &Path, item: &Item) -> Result<Vec<String>> {
    let last = item.revisions.last().and_then(|name| name.strip_prefix('m')?.parse::<u32>().ok());
    let next = last.map(|number| format!("m{}", number + 1));
    let first = item.revisions.len().saturating_sub(MOST_OVERLAID - 1);
    let study = home.join(&item.study);
    let revisions = item.revisions[first..].iter().chain(&next);
    let paths: Vec<String> = revisions.map(|name| absolute(&study.join(name))).collect::<Result<_>>()?;
    Ok(words(&["corner"], &[("out", Some(absolute(&study.join(CORNER_NAME).with_extension(""))?))], &paths))
}

/// Last message in a command's output, and its progress (finished steps, all steps).
fn last_message_and_progress(tail: &str) -> (Option<String>, Option<[u64; 2]>) {
    let mut lines = tail.lines().rev().filter(|line| !line.trim().is_empty());
    let Some(last) = lines.next() else { return (None, None) };
    let Some(progress) = last.strip_prefix(crate::terminal::PROGRESS) else { return (Some(last.into()), None) };
    let numbers = progress.split_once(" of ").and_then(|(a, b)| Some([a.parse().ok()?, b.parse().ok()?]));
    (lines.find(|line| !line.starts_with(crate::terminal::PROGRESS)).map(String::from), numbers)
}

/// Error message in the output of a command that failed.
fn find_error_message(tail: &str) -> String {
    match tail.rfind("error: ") {
        Some(at) => tail[at + "error: ".len()..].trim_end().to_string(),
        None => tail.lines().last().unwrap_or("the command ended without a message").to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn item(revisions: &[&str]) -> Item {
        Item {
            name: "eye".into(),
            experiment: Some("eye".into()),
            study: "vitreo-uq-out/eye".into(),
            revisions: revisions.iter().map(|name| (*name).into()).collect(),
            figures: Vec::new(),
        }
    }

    fn wish(kind: JobKind, revision: Option<&str>, with: &[&str]) -> JobRequest {
        let with = with.iter().map(|slug| (*slug).to_string()).collect();
        JobRequest { item: "eye".into(), kind, revision: revision.map(String::from), with }
    }

    #[test]
    fn wishes_are_commands_of_a_terminal() {
        let lines = |wish: &JobRequest, item: &Item| -> Vec<String> {
            commands(Path::new("/eyes"), wish, item, false, &[]).unwrap().iter().map(|words| words.join(" ")).collect()
        };
        assert_eq!(
            lines(&wish(JobKind::Sample, None, &[]), &item(&[])),
            ["sample --out=/eyes/vitreo-uq-out/eye -- /eyes/eye", "compare --from=m0 -- /eyes/vitreo-uq-out/eye"]
        );
        assert_eq!(
            lines(&wish(JobKind::Diagnose, None, &[]), &item(&["m0", "m1"])),
            ["diagnose --from=m1 -- /eyes/vitreo-uq-out/eye"]
        );
        assert_eq!(
            lines(&wish(JobKind::Extend, Some("m0"), &["wall-slip", "drift"]), &item(&["m0"]))[0],
            "extend --from=m0 --with=wall-slip,drift -- /eyes/vitreo-uq-out/eye"
        );
        assert_eq!(
            lines(&wish(JobKind::Extend, Some("m0"), &["drift"]), &item(&["m0", "m1"]))[3],
            "corner --out=/eyes/vitreo-uq-out/eye/corner -- /eyes/vitreo-uq-out/eye/m0 /eyes/vitreo-uq-out/eye/m1 /eyes/vitreo-uq-out/eye/m2"
        );
        assert_eq!(
            lines(&wish(JobKind::Adopt, None, &[]), &item(&["m0"]))[0],
            "extend --from=m0 --with=./vitreo-uq-out/eye/m0/learned-effect.toml -- /eyes/vitreo-uq-out/eye"
        );
    }

    #[test]
    fn no_word_of_a_wish_becomes_another_option() {
        vitreo_uq::base::error::rename_settings("command line", crate::settings::option);
        let refuses = |wish: JobRequest, revisions: &[&str], words: &str| {
            let error = commands(Path::new("/eyes"), &wish, &item(revisions), false, &[]).unwrap_err().to_string();
            assert!(error.contains(words), "`{words}` in {error}");
        };
        for with in [&["--force"][..], &["../x.toml"], &["a b"], &[]] {
            refuses(wish(JobKind::Extend, None, with), &["m0"], "`--with`: these are not names of effects");
        }
        for with in [&["--force"][..], &[]] {
            refuses(wish(JobKind::Groups, None, with), &[], "`--by`: this is not a key for groups");
        }
        for revision in ["--out", "m7", ""] {
            refuses(wish(JobKind::Diagnose, Some(revision), &[]), &["m0"], "this revision does not exist");
        }
        refuses(wish(JobKind::Compare, None, &[]), &[], "this revision does not exist");
    }

    #[test]
    fn words_and_progress_are_read_from_a_log() {
        let log = "fitting …\nrefitting every effect …\nprogress: 3 of 18\nprogress: 7 of 18\n";
        assert_eq!(last_message_and_progress(log), (Some("refitting every effect …".into()), Some([7, 18])));
        assert_eq!(last_message_and_progress("fitting …\n"), (Some("fitting …".into()), None));
        assert_eq!(last_message_and_progress(""), (None, None));
        assert_eq!(
            find_error_message("fitting …\nerror: a.csv:3: no number\n  what to do: mend it\n"),
            "a.csv:3: no number\n  what to do: mend it"
        );
    }
}
