//! Documents of `tasks` and `gather` (formats §6, `vitreo-uq/tasks/1` and `vitreo-uq/gathered/1`).

use serde::{Deserialize, Serialize};

/// Kinds of tasks in a list.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum TaskKind {
    /// Sampling of a cohort's experiments, each on its own as `groups` needs them.
    Sample,
    /// Challenges, played as by `challenge run`.
    Challenge,
    /// Records simulated from the prior of one experiment's model, each sampled as by `sample`.
    Calibration,
    /// Surrogates that experiments need, trained on the full-order model.
    Models,
    /// Commands of a text file, whose output is kept.
    Commands,
}

impl TaskKind {
    /// Name of the kind on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sample => "sample",
            Self::Challenge => "challenge",
            Self::Calibration => "calibration",
            Self::Models => "models",
            Self::Commands => "commands",
        }
    }
}

/// Body of `vitreo-uq/tasks/1`: the head of a list.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct TaskList {
    /// Kind of the tasks.
    pub kind: TaskKind,
    /// Version and source hash of the program that made the list. Other programs do not run its tasks.
    pub program: String,
    /// Directory in which the list was made. Relative paths in the list start here.
    pub directory: String,
    /// Number of tasks.
    pub tasks: usize,
    /// SHA-256 of `tasks.jsonl`, which has one line for each task.
    pub lines_sha256: String,
}

/// Body of `vitreo-uq/gathered/1`: state of a list's results.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Gathered {
    /// Kind of the tasks.
    pub kind: TaskKind,
    /// Version and source hash of the program.
    pub program: String,
    /// Number of tasks.
    pub tasks: usize,
    /// Number of sound results.
    pub results: usize,
    /// Tasks without a sound result.
    pub missing: Vec<MissingResult>,
    /// Files among the results that belong to no task of the list.
    pub foreign: Vec<String>,
}

/// A task without a sound result.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct MissingResult {
    /// Number of the task, from 0.
    pub task: usize,
    /// Name of the file that should hold its result.
    pub file: String,
    /// Reason why the result is not accepted.
    pub fault: Fault,
}

/// Reasons why a result is not accepted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Fault {
    /// The file does not exist.
    Absent,
    /// The file ends too early or cannot be read.
    Truncated,
    /// The content differs from the result that was written.
    Damaged,
    /// The file is the result of another task, of other input, or of another kind.
    OtherTask,
    /// Another program wrote the file.
    OtherProgram,
}

impl Fault {
    /// The fault in words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Absent => "absent",
            Self::Truncated => "cut short or unreadable",
            Self::Damaged => "changed since it was written",
            Self::OtherTask => "the result of another task or of other input",
            Self::OtherProgram => "written by another program",
        }
    }
}

impl Gathered {
    /// True if every task has its result.
    pub fn is_whole(&self) -> bool {
        self.missing.is_empty() && self.results == self.tasks
    }
}
