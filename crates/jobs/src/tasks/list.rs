//! List of tasks on disk.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use base::error::{Error, InputPlace, Result, Setting};
use base::files::{self, Content, to_json, write_together};
use documents::tasks::{TaskKind, TaskList};
use posterior::study::{Provenance, WithProvenance, sha256_hex};

const HEAD: &str = "tasks.json";
const LINES: &str = "tasks.jsonl";
const RESULTS: &str = "results";
/// Description of the directory in messages.
const WHAT: &str = "a list of tasks";
/// Number of digits of the id in the name of a task's result.
const ID_DIGITS: usize = 24;
/// Largest number of tasks of a list.
const MOST_TASKS: usize = 1_000_000;
const REMEDY: &str = "give the directory that `vitreo-uq tasks KIND --out DIR` made";
fn damaged() -> String {
    format!("make the list again with the same command and `{}`: existing results are kept and reused", Setting::Force)
}

/// One task: a line of `tasks.jsonl`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Task {
    /// Number, from 0.
    pub task: usize,
    /// SHA-256 of program, kind and arguments.
    pub id: String,
    /// Path of the result below the list's directory, named after the id.
    pub result: String,
    /// Command that runs the task.
    pub command: Vec<String>,
    /// Arguments of the computation. Inputs are given by their content.
    pub arguments: Value,
    /// Paths of the inputs. The arguments identify their content.
    pub paths: Vec<String>,
}

/// Computation of one task, before the list is made.
#[derive(Debug, Clone, PartialEq)]
pub struct TaskInput {
    /// Arguments of the computation. Inputs are given by their content.
    pub arguments: Value,
    /// Paths of the inputs.
    pub paths: Vec<String>,
}

impl Task {
    /// SHA-256 of the arguments, and so of the inputs.
    pub fn input_sha256(&self) -> String {
        sha256_hex(self.arguments.to_string().as_bytes())
    }

    /// Parses the arguments into `T`, the type that the list's kind of tasks uses.
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

/// List in memory, after it was made or read.
#[derive(Debug, Clone, PartialEq)]
pub struct List {
    dir: PathBuf,
    head: WithProvenance<TaskList>,
    text: Vec<u8>,
    /// Start of each line in bytes, and end of the last line.
    starts: Vec<usize>,
}

/// Outcome of making a list.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ListOutcome {
    /// The list is new.
    Made,
    /// The identical list existed.
    WasThere,
    /// Another list existed and was replaced.
    Replaced,
}

impl List {
    /// Writes the list of some work into a directory that is absent, empty, or holds a list. `program` is the version and the hash of the sources. Existing results stay.
    ///
    /// # Errors
    /// [`Error::Input`] if the directory holds other files, or another list without `force`; [`Error::File`] if it is not writable.
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

    /// Checks that the list may be written to its directory.
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

    /// Reads a list.
    ///
    /// # Errors
    /// [`Error::File`] or [`Error::Input`] if there is no list or it has been changed.
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

    /// Refuses a list of another program, whose results may differ.
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
                "use the program that made it, or make the list again with `{}`; then everything is computed again",
                Setting::Force
            ),
        ))
    }

    /// Directory of the list.
    pub fn dir(&self) -> &Path {
        &self.dir
    }

    /// Head of the list with its provenance.
    pub fn document(&self) -> &WithProvenance<TaskList> {
        &self.head
    }

    /// Head of the list.
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

    /// Returns one task.
    ///
    /// # Errors
    /// [`Error::Input`] if no task has this number.
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

    /// Path of a task's result.
    pub fn result_path(&self, task: &Task) -> PathBuf {
        self.dir.join(result_of(&task.id))
    }

    /// Names of the result files, except those still being written.
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

/// Id of a task: the hash of program, kind and arguments.
fn id_of(program: &str, kind: TaskKind, arguments: &Value) -> String {
    sha256_hex(format!("{program}\n{}\n{arguments}", kind.name()).as_bytes())
}

/// Path of a task's result below the list's directory. An id is hexadecimal, so the path cannot leave that directory.
fn result_of(id: &str) -> String {
    format!("{RESULTS}/{}.task", &id[..ID_DIGITS])
}

/// Absolute form of a path.
///
/// # Errors
/// [`Error::File`] if there is no current directory.
pub fn absolute(path: &Path) -> Result<PathBuf> {
    std::path::absolute(path).map_err(files::file_error("find", path))
}

/// Start of each line in bytes, and end of the last line.
fn starts(text: &[u8]) -> Vec<usize> {
    let ends = text.iter().enumerate().filter(|(_, byte)| **byte == b'\n').map(|(place, _)| place + 1);
    std::iter::once(0).chain(ends).collect()
}

pub(super) fn not_json(error: &serde_json::Error) -> Error {
    Error::numerical(format!("a task cannot be written as JSON: {error}"), "report this with the command that was run")
}
