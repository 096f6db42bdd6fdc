//! Error type of all crates.

use std::path::PathBuf;
use std::sync::OnceLock;

/// Result with the common [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// All kinds of errors, with the data for a helpful message.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An input file or argument is not acceptable. Nothing has been written.
    #[error("{place}: {found}\n  what to do: {remedy}")]
    Input {
        /// Place of the fault.
        place: InputPlace,
        /// Unacceptable content at that place.
        found: String,
        /// Action for the user.
        remedy: String,
    },
    /// The operating system refused a file operation.
    #[error("cannot {action} {}: {source}\n  what to do: {remedy}", path.display())]
    File {
        /// "read", "write", "create", …
        action: &'static str,
        /// File or directory.
        path: PathBuf,
        /// The operating system's reason.
        #[source]
        source: std::io::Error,
        /// Action for the user.
        remedy: String,
    },
    /// A computation failed in a way that is not the input's fault alone.
    #[error("{what}\n  what to do: {remedy}")]
    Numerical {
        /// Failed computation, with the relevant numbers.
        what: String,
        /// Action for the user.
        remedy: String,
    },
    /// A query outside the range on which a surrogate was trained.
    #[error(
        "{parameter} = {value:e} lies outside the surrogate's trained range [{lower:e}, {upper:e}]\n  what to do: widen the prior and rebuild the surrogate, or use the full finite-element model"
    )]
    OutsideTrainedRange {
        /// Parameter name, with unit.
        parameter: String,
        /// Requested value.
        value: f64,
        /// Lower end of the trained range.
        lower: f64,
        /// Upper end of the trained range.
        upper: f64,
    },
    /// The run was interrupted; its checkpoints are kept.
    #[error("interrupted; {kept}")]
    Interrupted {
        /// Kept results, and how to continue.
        kept: String,
    },
}

macro_rules! settings {
    ($($(#[$doc:meta])* $setting:ident $name:literal)*) => {
        /// Input that a caller gives to the library, such as the noise model. Errors name it by its [`Display`](std::fmt::Display): the plain name, or the program's name for it.
        ///
        /// To add a setting, add a line with its documentation and its plain name to the list in this file.
        /// The compiler then asks for its option in the program's table (`src/bin/vitreo-uq/settings.rs`), and a test checks that a command has this option.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum Setting {
            $($(#[$doc])* $setting,)*
        }

        impl Setting {
            /// All settings.
            pub const ALL: &[Self] = &[$(Self::$setting),*];

            /// The plain name, such as `noise`.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$setting => $name,)*
                }
            }
        }
    };
}

settings! {
    /// Base law.
    Base "base"
    /// Effects added to the base law.
    Effects "effects"
    /// Noise model.
    Noise "noise"
    /// Prior: the name of a built-in one, or a file.
    Prior "prior"
    /// Parameters held at given values.
    Fixed "fixed"
    /// Server of an external model.
    Forward "forward"
    /// Name of a model on that server.
    ForwardModel "forward_model"
    /// Mesh file.
    Mesh "mesh"
    /// Unit of the mesh file's coordinates.
    MeshUnit "mesh_unit"
    /// Revision of a study.
    Revision "revision"
    /// Number of walkers of the sampler.
    Chains "chains"
    /// Largest number of steps of the sampler.
    Steps "steps"
    /// Continue from a checkpoint.
    Resume "resume"
    /// Number of threads.
    Threads "threads"
    /// Directory of the results.
    Out "out"
    /// Replace existing results.
    Force "force"
    /// Replace an existing experiment.
    Replace "replace"
    /// Time scheme of a simulation.
    Scheme "scheme"
    /// Time step of a simulation in s.
    TimeStep "time_step_s"
    /// Number of mesh levels of a convergence study.
    Refine "refine"
    /// Number of first cycles from which a function is learned.
    FirstCycles "first_cycles"
    /// Keys that define the groups of a cohort.
    By "by"
    /// Measurements left out of a cohort.
    LeaveOut "leave_out"
    /// Column of the time in a table.
    TimeColumn "time"
    /// Column of the force in a table.
    ForceColumn "force"
    /// Column of the position in a table.
    PositionColumn "position"
    /// Column of the cycle in a table.
    CycleColumn "cycle"
    /// Column of x in a table.
    XColumn "x"
    /// Column of y in a table.
    YColumn "y"
    /// Column of z in a table.
    ZColumn "z"
    /// Tables to read from a file with several tables.
    Tables "table"
    /// Column of the tracks in a table.
    TrackColumn "track_column"
    /// Track to read.
    Track "track"
    /// Meaning of a blank force.
    BlankForce "blank_force"
    /// Sign between thousands.
    Thousands "thousands"
    /// Treatment of a clock that restarts.
    TimeRestarts "time_restarts"
    /// Treatment of equal times from a coarse clock.
    TimeTies "time_ties"
    /// Unit of the time in a table.
    TimeUnit "unit_time"
    /// Unit of the force in a table.
    ForceUnit "unit_force"
    /// Unit of the position in a table.
    PositionUnit "unit_position"
    /// Number of a task.
    Task "task"
    /// Part of a list of tasks.
    Part "part"
    /// Number of parts of a list of tasks.
    Parts "parts"
    /// Processor cores of a worker.
    Cores "cores"
    /// Time limit of a worker in minutes.
    Minutes "minutes"
    /// Memory of a worker in MiB.
    Memory "memory_mib"
    /// Number of simulated records.
    Count "count"
    /// Hidden effect of a challenge.
    HiddenEffect "effect"
    /// Pair of hidden effects of a challenge.
    Pair "pair"
    /// Hidden physics outside the library of effects.
    Outside "outside"
    /// Size of a hidden effect in standard deviations of the data.
    Strength "strength"
    /// Size of a hidden effect in its own unit.
    Size "size"
    /// Sizes of the hidden effects of many challenges, in standard deviations of the data.
    Signal "signal"
    /// Force protocol of a challenge.
    Protocol "protocol"
    /// Directory of cached trajectories.
    Cache "cache"
}

/// Names under which a program shows settings, see [`rename_settings`].
struct Naming {
    source: &'static str,
    name: fn(Setting) -> &'static str,
}

static NAMING: OnceLock<Naming> = OnceLock::new();

/// Sets how all later errors of this process name settings. `source` is the origin of the settings, such as "command line". Only the first call has an effect.
///
/// A program calls this before anything else. Otherwise settings keep their plain names.
pub fn rename_settings(source: &'static str, name: fn(Setting) -> &'static str) {
    NAMING.get_or_init(|| Naming { source, name });
}

impl std::fmt::Display for Setting {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(NAMING.get().map_or(self.name(), |naming| (naming.name)(*self)))
    }
}

/// Place in the input: a file, and if known its line (from 1) and its column or key.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct InputPlace {
    /// File, or `None` for input from the caller.
    pub file: Option<PathBuf>,
    /// Line, counted from 1.
    pub line: Option<usize>,
    /// Column name, TOML key or setting.
    pub key: Option<String>,
}

impl InputPlace {
    /// A place in a file.
    pub fn file(file: impl Into<PathBuf>) -> Self {
        Self { file: Some(file.into()), ..Self::default() }
    }
    /// A setting that the caller gave.
    pub fn setting(setting: Setting) -> Self {
        Self::default().at_key(setting.to_string())
    }
    /// Adds a line, counted from 1.
    pub fn at_line(mut self, line: usize) -> Self {
        self.line = Some(line);
        self
    }
    /// Adds a column name or TOML key.
    pub fn at_key(mut self, key: impl Into<String>) -> Self {
        self.key = Some(key.into());
        self
    }
}

impl std::fmt::Display for InputPlace {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let source = || NAMING.get().map(|naming| naming.source);
        let key = self.key.as_ref().map(|key| format!("`{key}`"));
        let line = self.line.map(|line| format!("line {line}"));
        let file = self.file.as_ref().map(|file| file.display().to_string());
        let parts: Vec<String> =
            [file.or_else(|| source().map(String::from)), line, key].into_iter().flatten().collect();
        if parts.is_empty() { f.write_str("input") } else { f.write_str(&parts.join(", ")) }
    }
}

impl Error {
    /// An [`Error::Input`].
    pub fn input(place: InputPlace, found: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Input { place, found: found.into(), remedy: remedy.into() }
    }
    /// An [`Error::File`].
    pub fn at_path(
        action: &'static str,
        path: impl Into<PathBuf>,
        source: std::io::Error,
        remedy: impl Into<String>,
    ) -> Self {
        Self::File { action, path: path.into(), source, remedy: remedy.into() }
    }
    /// An [`Error::Numerical`].
    pub fn numerical(what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Numerical { what: what.into(), remedy: remedy.into() }
    }
    /// Exit code of the program for this error: 2 for usage and input, 130 after an interruption (as by Ctrl-C), 1 for others.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Input { .. } | Self::File { .. } => 2,
            Self::Interrupted { .. } => 130,
            _ => 1,
        }
    }
}
