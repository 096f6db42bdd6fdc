//! The documents of `tasks` and `gather` (formats §6, `vitreo-uq/tasks/1` and `vitreo-uq/gathered/1`).

use serde::{Deserialize, Serialize};

/// What a list's tasks do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum TaskKind {
    /// Experiments of a cohort, each sampled on its own as `groups` takes it.
    Sample,
    /// Challenges, played as `challenge run` plays them.
    Challenge,
    /// Records simulated from the prior of one experiment's model, each sampled as `sample` does.
    Calibration,
    /// Reduced models that experiments need, trained on full finite elements.
    Models,
    /// Commands of a text, of which what they write is kept.
    Commands,
}

impl TaskKind {
    /// Its name on the command line.
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
    /// What the tasks do.
    pub kind: TaskKind,
    /// Version and hash of the sources of the program that made the list; no other runs its tasks.
    pub program: String,
    /// Directory in which the list was made: paths in it that are not absolute begin here.
    pub directory: String,
    /// Number of tasks.
    pub tasks: usize,
    /// SHA-256 of `tasks.jsonl`, which has a line for each.
    pub lines_sha256: String,
}

/// Body of `vitreo-uq/gathered/1`: what was there of a list's results.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Gathered {
    /// What the tasks do.
    pub kind: TaskKind,
    /// Version and hash of the sources of the program.
    pub program: String,
    /// Number of tasks.
    pub tasks: usize,
    /// Number of results that are there and sound.
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
    /// What is wrong with it.
    pub fault: Fault,
}

/// Why a result is not taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Fault {
    /// There is no file.
    Absent,
    /// The file ends before its content does, or cannot be read.
    Truncated,
    /// The content is not what was written.
    Damaged,
    /// The file is the result of another task, of other input, or of another kind.
    OtherTask,
    /// Another program wrote it.
    OtherProgram,
}

impl Fault {
    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Absent => "not there",
            Self::Truncated => "cut short or unreadable",
            Self::Damaged => "changed since it was written",
            Self::OtherTask => "the result of another task or of other input",
            Self::OtherProgram => "written by another program",
        }
    }
}

impl Gathered {
    /// Whether every task has its result.
    pub fn is_whole(&self) -> bool {
        self.missing.is_empty() && self.results == self.tasks
    }
}
