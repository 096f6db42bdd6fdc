//! Documents of `tasks` and `gather` (formats §6, `vitreo-uq/tasks/1` and `vitreo-uq/gathered/1`).

use serde::{Deserialize, Serialize};

base::named_enum! {
    /// Kinds of tasks that a list for many computers can have.
    #[derive(Serialize, Deserialize)]
    #[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
    #[serde(rename_all = "lowercase")]
    pub enum TaskKind {
        /// Sampling of a cohort's experiments one by one, as `groups` needs them.
        Sample = "sample",
        /// Challenges (records with a hidden effect), diagnosed as by `challenge run`.
        Challenge = "challenge",
        /// Records simulated from the prior of one experiment's model, each sampled as by `sample`.
        Calibration = "calibration",
        /// Training of the surrogates that experiments need, on the full-order model.
        Models = "models",
        /// Execution of a text file's commands, whose output is kept.
        Commands = "commands",
    }
    /// Name of the kind on the command line.
    pub fn name
}

/// Head of a list of tasks: body of the JSON document `vitreo-uq/tasks/1`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct TaskList {
    /// Kind of the tasks.
    pub kind: TaskKind,
    /// Version and source hash of the program that made the list. A program with another hash refuses to run its tasks.
    pub program: String,
    /// Directory in which the list was made. Relative paths in the list start there.
    pub directory: String,
    /// Number of tasks in the list.
    pub tasks: usize,
    /// SHA-256 of `tasks.jsonl`, which has one line for each task.
    pub lines_sha256: String,
}

/// State of a task list's results: body of the JSON document `vitreo-uq/gathered/1`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Gathered {
    /// Kind of the tasks.
    pub kind: TaskKind,
    /// Version and source hash of the program that made the list.
    pub program: String,
    /// Number of tasks in the list.
    pub tasks: usize,
    /// Number of tasks with an accepted result.
    pub results: usize,
    /// Tasks without an accepted result.
    pub missing: Vec<MissingResult>,
    /// Files among the results that belong to no task of the list.
    pub foreign: Vec<String>,
}

/// A task without an accepted result.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct MissingResult {
    /// Number of the task in its list, from 0.
    pub task: usize,
    /// Name of the file that should hold the task's result.
    pub file: String,
    /// Reason why the program does not accept the result.
    pub fault: Fault,
}

base::named_enum! {
    /// Reasons why the program does not accept a task's result.
    #[derive(Serialize, Deserialize)]
    #[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
    #[serde(rename_all = "kebab-case")]
    pub enum Fault {
        /// The result's file does not exist.
        Absent = "absent",
        /// The result's file ends too early or cannot be read.
        Truncated = "cut short or unreadable",
        /// The content of the file has changed since it was written.
        Damaged = "changed since it was written",
        /// The file is the result of another task, of other input, or of another kind.
        OtherTask = "the result of another task or of other input",
        /// A program with another version or source hash wrote the file.
        OtherProgram = "written by another program",
    }
    /// The fault in words, for people.
    pub fn words
}

impl Gathered {
    /// True if every task has an accepted result.
    pub fn is_whole(&self) -> bool {
        self.missing.is_empty() && self.results == self.tasks
    }
}
