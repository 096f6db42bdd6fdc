//! Error type that all crates use.

use std::path::PathBuf;
use std::sync::OnceLock;

/// Result type whose error is [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// Error with the data for a helpful message: what is wrong, where, and what to do.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An input file or argument is not acceptable. Nothing was written.
    #[error("{place}: {found}\n  what to do: {remedy}")]
    Input {
        /// Place of the fault in the input.
        place: InputPlace,
        /// Content found at that place.
        found: String,
        /// What the user can do.
        remedy: String,
    },
    /// The operating system refused an operation on a file or directory.
    #[error("cannot {action} {}: {source}\n  what to do: {remedy}", path.display())]
    File {
        /// Verb for the refused operation, such as "read", "write" or "create".
        action: &'static str,
        /// File or directory of the failed operation.
        path: PathBuf,
        /// Error of the operating system.
        #[source]
        source: std::io::Error,
        /// What the user can do.
        remedy: String,
    },
    /// A computation failed, and the input alone does not explain the failure.
    #[error("{what}\n  what to do: {remedy}")]
    Numerical {
        /// Description of the failed computation, with its numbers.
        what: String,
        /// What the user can do.
        remedy: String,
    },
    /// A parameter value lies outside the range on which a surrogate was trained.
    #[error(
        "{parameter} = {value:e} lies outside the surrogate's trained range [{lower:e}, {upper:e}]\n  what to do: widen the prior and rebuild the surrogate, or use the full finite-element model"
    )]
    OutsideTrainedRange {
        /// Name of the parameter, with its unit.
        parameter: String,
        /// Value of the parameter.
        value: f64,
        /// Lower end of the trained range.
        lower: f64,
        /// Upper end of the trained range.
        upper: f64,
    },
    /// The user interrupted the run. Its checkpoints are kept.
    #[error("interrupted; {kept}")]
    Interrupted {
        /// Description of the kept results, and how to continue.
        kept: String,
    },
}

crate::named_enum! {
    /// Setting that a caller passes to the library, such as the noise model. Errors show its [`Display`](std::fmt::Display) text: the plain name, or the
    /// program's own name for it ([`rename_settings`]).
    ///
    /// To add a setting, add a line with its documentation and its plain name to the list in this file. The compiler then asks for its option in the
    /// program's table (`src/bin/vitreo-uq/settings.rs`), and a test checks that a command has this option.
    pub enum Setting {
        /// Base law.
        Base = "base",
        /// Effects added to the base law.
        Effects = "effects",
        /// Noise model.
        Noise = "noise",
        /// Prior: name of a built-in prior, or a file.
        Prior = "prior",
        /// Parameters that are held at given values.
        Fixed = "fixed",
        /// Address of the server of an external model.
        Forward = "forward",
        /// Name of a model on the server of an external model.
        ForwardModel = "forward_model",
        /// Mesh file.
        Mesh = "mesh",
        /// Unit of the mesh file's coordinates.
        MeshUnit = "mesh_unit",
        /// Revision of a study: one of its models with its results.
        Revision = "revision",
        /// Number of walkers of the sampler.
        Chains = "chains",
        /// Largest number of steps of the sampler's walkers.
        Steps = "steps",
        /// Request to continue an interrupted run from its checkpoint.
        Resume = "resume",
        /// Number of threads that a computation uses.
        Threads = "threads",
        /// Directory of the results.
        Out = "out",
        /// Permission to replace existing results.
        Force = "force",
        /// Permission to replace an existing experiment.
        Replace = "replace",
        /// File of scenarios to predict.
        Scenario = "scenario",
        /// Later records of a specimen.
        After = "after",
        /// Table of the force of a prediction.
        ForceTable = "force",
        /// Name of the group of which a new specimen is predicted.
        NewEye = "new_eye",
        /// Largest force of a plan, in µN.
        LargestForce = "max_force_un",
        /// Time integration scheme of a simulation.
        Scheme = "scheme",
        /// Time step of a simulation in s.
        TimeStep = "time_step_s",
        /// Number of mesh levels of a convergence study.
        Refine = "refine",
        /// Number of first cycles from which `learn` infers a correction.
        FirstCycles = "first_cycles",
        /// Keys that define the groups of a cohort.
        By = "by",
        /// Records or specimens to leave out of a cohort.
        LeaveOut = "leave_out",
        /// Column that holds the time in a table.
        TimeColumn = "time",
        /// Column that holds the force in a table.
        ForceColumn = "force",
        /// Column that holds the position in a table.
        PositionColumn = "position",
        /// Column that holds the cycle number in a table.
        CycleColumn = "cycle",
        /// Column that holds the x coordinate in a table.
        XColumn = "x",
        /// Column that holds the y coordinate in a table.
        YColumn = "y",
        /// Column that holds the z coordinate in a table.
        ZColumn = "z",
        /// Column that holds the frequency in a table of moduli.
        FrequencyColumn = "frequency",
        /// Columns that hold the two moduli of an oscillation, or a modulus and the phase.
        ModuliColumns = "moduli",
        /// Names of the tables to read from a file with several tables.
        Tables = "table",
        /// Kind of a record: creep or relaxation.
        Kind = "kind",
        /// Column that holds the track identifier in a table of several tracks.
        TrackColumn = "track_column",
        /// Identifier of the track to read.
        Track = "track",
        /// Time at which the load of the first row began.
        LoadStart = "load_start",
        /// Force that an empty force cell stands for.
        BlankForce = "blank_force",
        /// File that contains the force, if the table does not.
        ForceFile = "force_file",
        /// Character that separates thousands in numbers.
        Thousands = "thousands",
        /// Treatment of a clock that restarts within the record.
        TimeRestarts = "time_restarts",
        /// Treatment of rows with equal times, which a coarse clock produces.
        TimeTies = "time_ties",
        /// Unit of the time in a table.
        TimeUnit = "unit_time",
        /// Unit of the frequency in a table of moduli.
        FrequencyUnit = "unit_frequency",
        /// Unit of the moduli of an oscillation.
        ModuliUnit = "unit_moduli",
        /// Unit of the force in a table.
        ForceUnit = "unit_force",
        /// Unit of the position in a table.
        PositionUnit = "unit_position",
        /// Diameter of a bead or robot, in mm.
        RobotDiameter = "robot_diameter_mm",
        /// Radius of a tip that is pressed into a gel, in µm.
        TipRadius = "tip_radius_um",
        /// Stiffness in N/m of the spring that carries a tip.
        CantileverStiffness = "cantilever_n_per_m",
        /// Length of a specimen along the force, in mm.
        SpecimenLength = "specimen_length_mm",
        /// Cross-section of a specimen, in mm².
        SpecimenArea = "specimen_area_mm2",
        /// Number of the task to run in a list of tasks.
        Task = "task",
        /// Number of the part of a task list to run.
        Part = "part",
        /// Number of parts into which a list of tasks is divided.
        Parts = "parts",
        /// Number of processor cores per worker.
        Cores = "cores",
        /// Time limit of a worker in minutes.
        Minutes = "minutes",
        /// Memory of a worker in MiB.
        Memory = "memory_mib",
        /// Number of simulated records of a calibration or of challenges.
        Count = "count",
        /// Effect to hide in a challenge.
        HiddenEffect = "effect",
        /// Pair of effects to hide in a challenge.
        Pair = "pair",
        /// Physical mechanism outside the library of effects, to hide in a challenge.
        Outside = "outside",
        /// Size of a challenge's hidden effect, in standard deviations of the data.
        Strength = "strength",
        /// Size of a challenge's hidden effect, in the unit of the effect's parameter.
        Size = "size",
        /// Sizes of the hidden effects in a series of challenges, in standard deviations of the data.
        Signal = "signal",
        /// Force protocol of a challenge.
        Protocol = "protocol",
        /// Directory with the cached trajectories.
        Cache = "cache",
    }
    /// Plain name of the setting, such as `noise`.
    pub fn name
}

/// Origin and names of the settings, as errors show them. [`rename_settings`] sets both.
struct Naming {
    source: &'static str,
    name: fn(Setting) -> &'static str,
}

static NAMING: OnceLock<Naming> = OnceLock::new();

/// Sets the names by which all later errors of this process refer to settings. `source` names the origin of the settings, such as "command
/// line". Only the first call has an effect.
///
/// A program should call this function before anything else. Without a call, errors use the plain names.
pub fn rename_settings(source: &'static str, name: fn(Setting) -> &'static str) {
    NAMING.get_or_init(|| Naming { source, name });
}

impl std::fmt::Display for Setting {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(NAMING.get().map_or(self.name(), |naming| (naming.name)(*self)))
    }
}

/// Place of a fault in the input: the file, the line, and the column or key, as far as they are known.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct InputPlace {
    /// File; `None` if the caller passed the input directly.
    pub file: Option<PathBuf>,
    /// Line, counted from 1.
    pub line: Option<usize>,
    /// Column name, TOML key or setting.
    pub key: Option<String>,
}

impl InputPlace {
    /// Makes a place that names a file.
    pub fn file(file: impl Into<PathBuf>) -> Self {
        Self { file: Some(file.into()), ..Self::default() }
    }
    /// Makes a place that names a setting of the caller.
    pub fn setting(setting: Setting) -> Self {
        Self::default().at_key(setting.to_string())
    }
    /// Adds a line number, counted from 1.
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
    /// Makes an [`Error::Input`].
    pub fn input(place: InputPlace, found: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Input { place, found: found.into(), remedy: remedy.into() }
    }
    /// Makes an [`Error::File`].
    pub fn at_path(
        action: &'static str,
        path: impl Into<PathBuf>,
        source: std::io::Error,
        remedy: impl Into<String>,
    ) -> Self {
        Self::File { action, path: path.into(), source, remedy: remedy.into() }
    }
    /// Makes an [`Error::Numerical`].
    pub fn numerical(what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Numerical { what: what.into(), remedy: remedy.into() }
    }
    /// Exit code of the program: 2 for errors of usage, input or files, 130 after an interruption (such as Ctrl-C), 1 for all other errors.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Input { .. } | Self::File { .. } => 2,
            Self::Interrupted { .. } => 130,
            _ => 1,
        }
    }
}
