//! The list of tasks on disk.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use base::error::{Error, Place, Result, Setting};
use base::files::{self, Content, to_json, write_together};
use documents::tasks::{TaskKind, TaskList};
use posterior::study::{Provenance, WithProvenance, sha256_hex};

const HEAD: &str = "tasks.json";
const LINES: &str = "tasks.jsonl";
const RESULTS: &str = "results";
/// What its directory is, for messages.
const WHAT: &str = "a list of tasks";
/// Digits of its id that name a task's result.
const ID_DIGITS: usize = 24;
/// Most tasks of a list.
const MOST_TASKS: usize = 1_000_000;
const REMEDY: &str = "give the directory that `vitreo-uq tasks KIND --out DIR` made";
fn damaged() -> String {
    format!(
        "make the list again with the same command and `{}`: results that are there are kept and used",
        Setting::Force
    )
}

/// One task: a line of `tasks.jsonl`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Task {
    /// Number, from 0.
    pub task: usize,
    /// SHA-256 of program, kind and arguments.
    pub id: String,
    /// Where its result goes, below the list's directory: named after the id, for those who look for it.
    pub result: String,
    /// The command that runs it.
    pub command: Vec<String>,
    /// What it computes, input by content.
    pub arguments: Value,
    /// Where the input stands; what it is, the arguments say.
    pub paths: Vec<String>,
}

/// What a kind says of a task.
#[derive(Debug, Clone, PartialEq)]
pub struct Work {
    /// What is computed, input by content.
    pub arguments: Value,
    /// Where the input stands.
    pub paths: Vec<String>,
}

impl Task {
    /// SHA-256 of the arguments, and so of the input.
    pub fn input_sha256(&self) -> String {
        sha256_hex(self.arguments.to_string().as_bytes())
    }

    /// The arguments as a kind understands them.
    ///
    /// # Errors
    /// [`Error::Input`] where the line is not of this program.
    pub fn understood<T: serde::de::DeserializeOwned>(&self) -> Result<T> {
        serde_json::from_value(self.arguments.clone()).map_err(|error| {
            Error::input(
                Place::file(LINES).at_line(self.task + 1),
                format!("these are no arguments of this program: {error}"),
                damaged(),
            )
        })
    }
}

/// A list that was made or read.
#[derive(Debug, Clone, PartialEq)]
pub struct List {
    dir: PathBuf,
    head: WithProvenance<TaskList>,
    text: Vec<u8>,
    /// Where each line starts, and where the last ends.
    starts: Vec<usize>,
}

/// What making a list came to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Making {
    /// It is new.
    Made,
    /// The very same was there.
    WasThere,
    /// Another was there, whose place it took.
    Replaced,
}

impl List {
    /// Writes the list of some work of a `program` (its version and the hash of its sources) into a directory that is absent, empty, or holds a list. Results that are there stay.
    ///
    /// # Errors
    /// [`Error::Input`] where the directory holds other files, or another list and `force` is not set; [`Error::File`] where it cannot be written.
    pub fn make(
        dir: &Path,
        kind: TaskKind,
        program: &str,
        seed: u64,
        work: Vec<Work>,
        force: bool,
    ) -> Result<(Self, Making)> {
        if work.is_empty() || work.len() > MOST_TASKS {
            let found = format!("{} tasks", work.len());
            return Err(Error::input(Place::file(dir), found, format!("make lists of 1 to {MOST_TASKS} tasks")));
        }
        files::enclose(dir, WHAT);
        let absolute = absolute(dir)?;
        let mut text = Vec::new();
        for (task, Work { arguments, paths }) in work.into_iter().enumerate() {
            let id = id_of(program, kind, &arguments);
            let result = result_of(&id);
            let place = absolute.display().to_string();
            let command = ["vitreo-uq", "tasks", "run", &place, "--task", &task.to_string()].map(String::from).to_vec();
            let line = Task { task, id, result, command, arguments, paths };
            serde_json::to_writer(&mut text, &line).map_err(|error| not_json(&error))?;
            text.push(b'\n');
        }
        let starts = starts(&text);
        let directory = std::env::current_dir().map_err(files::refused("find", Path::new(".")))?;
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
        if making != Making::WasThere {
            let results = dir.join(RESULTS);
            files::create_folders(&results, &format!("choose a writable place with `{}`", Setting::Out))?;
            files::enclose(dir, WHAT);
            let (head, lines) = (dir.join(HEAD), dir.join(LINES));
            let document = to_json(&head, &list.head)?;
            write_together(&[(lines.as_path(), list.text.as_slice()), (head.as_path(), document.as_slice())])?;
        }
        Ok((list, making))
    }

    /// Whether the list may stand in its directory.
    fn place(&self, force: bool) -> Result<Making> {
        let head = self.dir.join(HEAD);
        if files::kind(&head).is_some() || files::kind(&self.dir.join(LINES)).is_some() {
            let is_same = Self::open(&self.dir).is_ok_and(|there| there.head == self.head);
            return match (is_same, force) {
                (true, _) => Ok(Making::WasThere),
                (false, true) => Ok(Making::Replaced),
                (false, false) => Err(Error::input(
                    Place::file(head),
                    "this is a list of other tasks: of other input, other options or another program",
                    format!(
                        "choose another directory with `{}`, or replace the list with `{}` (results that are there are kept, and those of the same tasks used)",
                        Setting::Out,
                        Setting::Force
                    ),
                )),
            };
        }
        let is_empty = match std::fs::read_dir(&self.dir) {
            Ok(mut entries) => entries.next().is_none(),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => true,
            Err(error) => return Err(files::refused("use", &self.dir)(error)),
        };
        if is_empty {
            return Ok(Making::Made);
        }
        Err(Error::input(
            Place::file(&self.dir),
            "this is no list of tasks, and it is not empty",
            format!("choose a new or empty directory with `{}`", Setting::Out),
        ))
    }

    /// Reads a list.
    ///
    /// # Errors
    /// [`Error::File`] or [`Error::Input`] where there is none, or where it is not as it was written.
    pub fn open(dir: &Path) -> Result<Self> {
        files::enclose(dir, WHAT);
        let path = dir.join(HEAD);
        let bytes = files::read(&path, Content::Document, REMEDY)?;
        let head: WithProvenance<TaskList> = serde_json::from_slice(&bytes).map_err(|error| {
            let place = Place::file(&path).at_line(error.line());
            Error::input(place, format!("this is no list of tasks of this program: {error}"), REMEDY)
        })?;
        let path = dir.join(LINES);
        let text = files::read(&path, Content::Table, &damaged())?;
        let starts = starts(&text);
        if sha256_hex(&text) != head.body.lines_sha256 || starts.len() != head.body.tasks + 1 {
            let found = format!("these lines are not those that {HEAD} speaks of: the file was changed or cut short");
            return Err(Error::input(Place::file(&path), found, damaged()));
        }
        Ok(Self { dir: dir.to_path_buf(), head, text, starts })
    }

    /// Refuses a list of another program: what this one computes may differ.
    ///
    /// # Errors
    /// [`Error::Input`].
    pub fn of_program(self, program: &str) -> Result<Self> {
        if self.head.body.program == program {
            return Ok(self);
        }
        Err(Error::input(
            Place::file(self.dir.join(HEAD)),
            format!("this list was made by vitreo-uq {}, and this is {program}", self.head.body.program),
            format!(
                "use the program that made it; or make the list again with this one and `{}`, and all is computed again",
                Setting::Force
            ),
        ))
    }

    /// Its directory.
    pub fn dir(&self) -> &Path {
        &self.dir
    }

    /// The document that its head is.
    pub fn document(&self) -> &WithProvenance<TaskList> {
        &self.head
    }

    /// Its head.
    pub fn head(&self) -> &TaskList {
        &self.head.body
    }

    /// Seed of all that its tasks draw.
    pub fn seed(&self) -> u64 {
        self.head.provenance.seed
    }

    /// Number of tasks.
    pub fn n_tasks(&self) -> usize {
        self.starts.len() - 1
    }

    /// One task.
    ///
    /// # Errors
    /// [`Error::Input`] where there is none of this number.
    pub fn task(&self, number: usize) -> Result<Task> {
        let (Some(from), Some(to)) = (self.starts.get(number), self.starts.get(number + 1)) else {
            let found = format!("there is no task {number}");
            let remedy = format!("give a number from 0 to {}", self.n_tasks() - 1);
            return Err(Error::input(Place::setting(Setting::Task), found, remedy));
        };
        let refuse =
            |found: String| Error::input(Place::file(self.dir.join(LINES)).at_line(number + 1), found, damaged());
        let task: Task = serde_json::from_slice(&self.text[*from..*to])
            .map_err(|error| refuse(format!("this is no task of this program: {error}")))?;
        let TaskList { program, kind, .. } = &self.head.body;
        let id = id_of(program, *kind, &task.arguments);
        if task.task != number || task.id != id || task.result != result_of(&id) {
            return Err(refuse(format!(
                "number, id or result are not those of this task: expected {number}, {id} and {}",
                result_of(&id)
            )));
        }
        Ok(task)
    }

    /// Where a task's result goes.
    pub fn result_path(&self, task: &Task) -> PathBuf {
        self.dir.join(result_of(&task.id))
    }

    /// Names of the files among the results; those that are being written are left out.
    ///
    /// # Errors
    /// [`Error::File`] where the directory cannot be read.
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

/// A task's id: the hash of what it computes.
fn id_of(program: &str, kind: TaskKind, arguments: &Value) -> String {
    sha256_hex(format!("{program}\n{}\n{arguments}", kind.name()).as_bytes())
}

/// Where the result of a task goes, below the list's directory. An id is hexadecimal, so that this leads nowhere else.
fn result_of(id: &str) -> String {
    format!("{RESULTS}/{}.task", &id[..ID_DIGITS])
}

/// A path that means the same from any directory.
///
/// # Errors
/// [`Error::File`] where there is no present directory.
pub fn absolute(path: &Path) -> Result<PathBuf> {
    std::path::absolute(path).map_err(files::refused("find", path))
}

/// Where lines start, and where the last ends.
fn starts(text: &[u8]) -> Vec<usize> {
    let ends = text.iter().enumerate().filter(|(_, byte)| **byte == b'\n').map(|(place, _)| place + 1);
    std::iter::once(0).chain(ends).collect()
}

pub(super) fn not_json(error: &serde_json::Error) -> Error {
    Error::numerical(format!("a task cannot be written as JSON: {error}"), "report this with the command that was run")
}
