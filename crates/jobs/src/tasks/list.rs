//! List of tasks for one or more machines, stored as files in a directory.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use base::sha256::sha256_hex;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use base::error::{Error, InputPlace, Result, Setting};
use base::files::{self, Content, to_json, write_together};
use documents::tasks::{TaskKind, TaskList};
use posterior::study::{Provenance, WithProvenance};

const HEAD: &str = "tasks.json";
const LINES: &str = "tasks.jsonl";
const RESULTS: &str = "results";
/// Description of the list's directory in messages.
const WHAT: &str = "a list of tasks";
/// Number of digits of a task's id that the name of its result contains.
const ID_DIGITS: usize = 24;
/// Largest number of tasks in a list.
const MOST_TASKS: usize = 1_000_000;
const REMEDY: &str = "give the directory that `vitreo-uq tasks KIND --out DIR` made";
fn damaged() -> String {
    format!("make the list again with the same command and `{}`: existing results are kept and reused", Setting::Force)
}

/// One task: a line of `tasks.jsonl`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Task {
    /// Number of the task, counted from 0.
    pub task: usize,
    /// Identifier: SHA-256 of program, kind of task and arguments.
    pub id: String,
    /// Path of the task's result file, relative to the list's directory. The file is named after the task's id.
    pub result: String,
    /// Words of the command that runs the task.
    pub command: Vec<String>,
    /// Arguments of the computation. They identify input files by the hashes of their content.
    pub arguments: Value,
    /// Paths of the input files.
    pub paths: Vec<String>,
}

/// Input of one task, from which the list is made.
#[derive(Debug, Clone, PartialEq)]
pub struct TaskInput {
    /// Arguments of the computation. They identify input files by the hashes of their content.
    pub arguments: Value,
    /// Paths of the input files.
    pub paths: Vec<String>,
}

impl Task {
    /// SHA-256 of the arguments. It also identifies the input files, because the arguments contain their hashes.
    pub fn input_sha256(&self) -> String {
        sha256_hex(self.arguments.to_string().as_bytes())
    }

    /// Path of the only input.
    ///
    /// # Errors
    /// [`Error::Input`] if there is none.
    pub(super) fn path(&self) -> Result<&Path> {
        self.paths.first().map(Path::new).ok_or_else(|| self.refusal("has no path"))
    }

    /// Error of a task whose line `found` describes.
    pub(super) fn refusal(&self, found: &str) -> Error {
        let remedy = format!("make the list again with `{}`", Setting::Force);
        Error::input(InputPlace::default(), format!("task {} {found}", self.task), remedy)
    }

    /// Converts the arguments to `T`, the argument type of the list's kind of tasks.
    ///
    /// # Errors
    /// [`Error::Input`] if the arguments are not valid for this program.
    pub fn arguments_as<T: serde::de::DeserializeOwned>(&self) -> Result<T> {
        serde_json::from_value(self.arguments.clone()).map_err(|error| {
            Error::input(
                InputPlace::file(LINES).at_line(self.task + 1),
                format!("these arguments are not valid for this program: {error}"),
                damaged(),
            )
        })
    }
}

/// List of tasks in memory.
#[derive(Debug, Clone, PartialEq)]
pub struct List {
    dir: PathBuf,
    head: WithProvenance<TaskList>,
    text: Vec<u8>,
    /// Position of each line's first byte in the text. The last entry is the end of the text.
    starts: Vec<usize>,
}

/// Outcome of writing a list to its directory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ListOutcome {
    /// The directory had no list.
    Made,
    /// The directory had an identical list.
    WasThere,
    /// The directory had another list, which was replaced.
    Replaced,
}

impl List {
    /// Makes a list and writes it into a directory that does not exist, is empty or holds a list. `program` is the version of this program with the hash
    /// of its sources. Existing results are kept.
    ///
    /// # Errors
    /// [`Error::Input`] if the directory holds other files, or another list and `force` is not set; [`Error::File`] if it is not writable.
    pub fn make(
        dir: &Path,
        kind: TaskKind,
        program: &str,
        seed: u64,
        work: Vec<TaskInput>,
        force: bool,
    ) -> Result<(Self, ListOutcome)> {
        if work.is_empty() || work.len() > MOST_TASKS {
            let found = format!("{} tasks", work.len());
            return Err(Error::input(InputPlace::file(dir), found, format!("make lists of 1 to {MOST_TASKS} tasks")));
        }
        files::forbid_links(dir, WHAT);
        let absolute = absolute(dir)?;
        let mut text = Vec::new();
        for (task, TaskInput { arguments, paths }) in work.into_iter().enumerate() {
            let id = id_of(program, kind, &arguments);
            let result = result_of(&id);
            let place = absolute.display().to_string();
            let command = ["vitreo-uq", "tasks", "run", &place, "--task", &task.to_string()].map(String::from).to_vec();
            let line = Task { task, id, result, command, arguments, paths };
            serde_json::to_writer(&mut text, &line).map_err(|error| not_json(&error))?;
            text.push(b'\n');
        }
        let starts = starts(&text);
        let directory = std::env::current_dir().map_err(files::file_error("find", Path::new(".")))?;
        let body = TaskList {
            kind,
            program: program.into(),
            directory: directory.display().to_string(),
            tasks: starts.len() - 1,
            lines_sha256: sha256_hex(&text),
        };
        let head = WithProvenance { provenance: Provenance::new("tasks", 1, seed, BTreeMap::new()), body };
        let list = Self { dir: dir.to_path_buf(), head, text, starts };
        let making = list.place(force)?;
        if making != ListOutcome::WasThere {
            let results = dir.join(RESULTS);
            files::create_folders(&results, &format!("choose a writable place with `{}`", Setting::Out))?;
            files::forbid_links(dir, WHAT);
            let (head, lines) = (dir.join(HEAD), dir.join(LINES));
            let document = to_json(&head, &list.head)?;
            write_together(&[(lines.as_path(), list.text.as_slice()), (head.as_path(), document.as_slice())])?;
        }
        Ok((list, making))
    }

    /// Checks whether the list may be written into its directory. Returns `WasThere` for an identical list, and otherwise the outcome that writing will
    /// have.
    fn place(&self, force: bool) -> Result<ListOutcome> {
        let head = self.dir.join(HEAD);
        if files::kind(&head).is_some() || files::kind(&self.dir.join(LINES)).is_some() {
            let is_same = Self::open(&self.dir).is_ok_and(|there| there.head == self.head);
            return match (is_same, force) {
                (true, _) => Ok(ListOutcome::WasThere),
                (false, true) => Ok(ListOutcome::Replaced),
                (false, false) => Err(Error::input(
                    InputPlace::file(head),
                    "this list has other tasks: its inputs, options or program differ",
                    format!(
                        "choose another directory with `{}`, or replace the list with `{}` (existing results are kept and reused for equal tasks)",
                        Setting::Out,
                        Setting::Force
                    ),
                )),
            };
        }
        let is_empty = match std::fs::read_dir(&self.dir) {
            Ok(mut entries) => entries.next().is_none(),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => true,
            Err(error) => return Err(files::file_error("use", &self.dir)(error)),
        };
        if is_empty {
            return Ok(ListOutcome::Made);
        }
        Err(Error::input(
            InputPlace::file(&self.dir),
            "this directory is not empty and holds no list of tasks",
            format!("choose a new or empty directory with `{}`", Setting::Out),
        ))
    }

    /// Reads a list from its directory.
    ///
    /// # Errors
    /// [`Error::File`] or [`Error::Input`] if there is no list, or if it was changed by hand.
    pub fn open(dir: &Path) -> Result<Self> {
        files::forbid_links(dir, WHAT);
        let path = dir.join(HEAD);
        let bytes = files::read(&path, Content::Document, REMEDY)?;
        let head: WithProvenance<TaskList> = serde_json::from_slice(&bytes).map_err(|error| {
            let place = InputPlace::file(&path).at_line(error.line());
            Error::input(place, format!("this is not a list of tasks of this program: {error}"), REMEDY)
        })?;
        let path = dir.join(LINES);
        let text = files::read(&path, Content::Table, &damaged())?;
        let starts = starts(&text);
        if sha256_hex(&text) != head.body.lines_sha256 || starts.len() != head.body.tasks + 1 {
            let found = format!("these lines do not match {HEAD}: the file was changed or cut short");
            return Err(Error::input(InputPlace::file(&path), found, damaged()));
        }
        Ok(Self { dir: dir.to_path_buf(), head, text, starts })
    }

    /// Refuses a list that another program version made, because its results may differ. Otherwise returns the list.
    ///
    /// # Errors
    /// [`Error::Input`] if the programs differ.
    pub fn check_program(self, program: &str) -> Result<Self> {
        if self.head.body.program == program {
            return Ok(self);
        }
        Err(Error::input(
            InputPlace::file(self.dir.join(HEAD)),
            format!("this list was made by vitreo-uq {}, but this program is {program}", self.head.body.program),
            format!(
                "use the program that made the list, or make the list again with `{}`, which computes all results again",
                Setting::Force
            ),
        ))
    }

    /// Directory that holds the list.
    pub fn dir(&self) -> &Path {
        &self.dir
    }

    /// Head of the list, with its provenance (program, seed, inputs).
    pub fn document(&self) -> &WithProvenance<TaskList> {
        &self.head
    }

    /// Head of the list, without its provenance.
    pub fn head(&self) -> &TaskList {
        &self.head.body
    }

    /// Seed of all random numbers of the tasks.
    pub fn seed(&self) -> u64 {
        self.head.provenance.seed
    }

    /// Number of tasks.
    pub fn n_tasks(&self) -> usize {
        self.starts.len() - 1
    }

    /// Returns the task with this number.
    ///
    /// # Errors
    /// [`Error::Input`] if there is no such task.
    pub fn task(&self, number: usize) -> Result<Task> {
        let (Some(from), Some(to)) = (self.starts.get(number), self.starts.get(number + 1)) else {
            let found = format!("there is no task {number}");
            let remedy = format!("give a number from 0 to {}", self.n_tasks() - 1);
            return Err(Error::input(InputPlace::setting(Setting::Task), found, remedy));
        };
        let refuse =
            |found: String| Error::input(InputPlace::file(self.dir.join(LINES)).at_line(number + 1), found, damaged());
        let task: Task = serde_json::from_slice(&self.text[*from..*to])
            .map_err(|error| refuse(format!("this is not a task of this program: {error}")))?;
        let TaskList { program, kind, .. } = &self.head.body;
        let id = id_of(program, *kind, &task.arguments);
        if task.task != number || task.id != id || task.result != result_of(&id) {
            return Err(refuse(format!(
                "number, id or result do not match this task: expected {number}, {id} and {}",
                result_of(&id)
            )));
        }
        Ok(task)
    }

    /// Path of a task's result file.
    pub fn result_path(&self, task: &Task) -> PathBuf {
        self.dir.join(result_of(&task.id))
    }

    /// Names of all result files in the list's directory. Files that are still being written are left out.
    ///
    /// # Errors
    /// [`Error::File`] if the directory is unreadable.
    pub fn result_names(&self) -> Result<Vec<String>> {
        let folder = self.dir.join(RESULTS);
        let mut names = Vec::new();
        for (name, _) in files::entries(&folder, "make the directory readable")? {
            let name = name.to_string_lossy();
            if !name.starts_with('.') {
                names.push(format!("{RESULTS}/{name}"));
            }
        }
        names.sort();
        Ok(names)
    }
}

/// Id of a task: SHA-256 of program, kind and arguments.
fn id_of(program: &str, kind: TaskKind, arguments: &Value) -> String {
    sha256_hex(format!("{program}\n{}\n{arguments}", kind.name()).as_bytes())
}

/// Path of a task's result, relative to the list's directory. The id is hexadecimal, so the path cannot leave this directory.
fn result_of(id: &str) -> String {
    format!("{RESULTS}/{}.task", &id[..ID_DIGITS])
}

/// Makes a path absolute, without resolving links.
///
/// # Errors
/// [`Error::File`] if there is no current directory.
pub fn absolute(path: &Path) -> Result<PathBuf> {
    std::path::absolute(path).map_err(files::file_error("find", path))
}

/// Position of each line's first byte in the text, then the end of the text.
fn starts(text: &[u8]) -> Vec<usize> {
    let ends = text.iter().enumerate().filter(|(_, byte)| **byte == b'\n').map(|(place, _)| place + 1);
    std::iter::once(0).chain(ends).collect()
}

pub(super) fn not_json(error: &serde_json::Error) -> Error {
    Error::numerical(format!("a task cannot be written as JSON: {error}"), "report this with the command that was run")
}
