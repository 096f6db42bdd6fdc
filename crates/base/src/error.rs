//! The one error type of the crate.

use std::path::PathBuf;

/// Result with the crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// Everything that can go wrong, with the data needed to say what to do about it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An input file or argument is not acceptable. Nothing has been written.
    #[error("{place}: {found}\n  what to do: {remedy}")]
    Input {
        /// Where it stands.
        place: Place,
        /// What was found there.
        found: String,
        /// What the user should do.
        remedy: String,
    },
    /// The operating system refused a file operation.
    #[error("cannot {action} {}: {source}\n  what to do: {remedy}", path.display())]
    File {
        /// "read", "write", "create", …
        action: &'static str,
        /// The file or directory.
        path: PathBuf,
        /// The operating system's reason.
        #[source]
        source: std::io::Error,
        /// What the user should do.
        remedy: String,
    },
    /// A computation failed in a way that is not the input's fault alone.
    #[error("{what}\n  what to do: {remedy}")]
    Numerical {
        /// What failed, with the numbers that matter.
        what: String,
        /// What the user should do.
        remedy: String,
    },
    /// A query outside the range on which a surrogate was trained.
    #[error(
        "{parameter} = {value:e} lies outside the surrogate's trained range [{lower:e}, {upper:e}]\n  what to do: widen the prior and rebuild the surrogate, or use the full finite-element model"
    )]
    OutsideTrainedRange {
        /// Parameter name, with unit.
        parameter: String,
        /// The value asked for.
        value: f64,
        /// Lower end of the trained range.
        lower: f64,
        /// Upper end of the trained range.
        upper: f64,
    },
    /// The run was interrupted; what had been checkpointed is kept.
    #[error("interrupted; {kept}")]
    Interrupted {
        /// What is kept and how to go on.
        kept: String,
    },
}

/// Where in the input something stands: a file, and where known its line (from 1) and its column or key.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Place {
    /// File, or `None` for the command line.
    pub file: Option<PathBuf>,
    /// Line, counted from 1.
    pub line: Option<usize>,
    /// Column name, TOML key or option.
    pub key: Option<String>,
}

impl Place {
    /// A place in a file.
    pub fn file(file: impl Into<PathBuf>) -> Self {
        Self { file: Some(file.into()), ..Self::default() }
    }
    /// A command-line option such as `--set`.
    pub fn option(name: impl Into<String>) -> Self {
        Self { key: Some(name.into()), ..Self::default() }
    }
    /// The same place, at a line counted from 1.
    pub fn at_line(mut self, line: usize) -> Self {
        self.line = Some(line);
        self
    }
    /// The same place, at a column name or TOML key.
    pub fn at_key(mut self, key: impl Into<String>) -> Self {
        self.key = Some(key.into());
        self
    }
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match &self.file {
            Some(file) => write!(f, "{}", file.display())?,
            None => write!(f, "command line")?,
        }
        if let Some(line) = self.line {
            write!(f, ", line {line}")?;
        }
        if let Some(key) = &self.key {
            write!(f, ", `{key}`")?;
        }
        Ok(())
    }
}

impl Error {
    /// An [`Error::Input`].
    pub fn input(place: Place, found: impl Into<String>, remedy: impl Into<String>) -> Self {
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
    /// The program's exit code for this error: 2 for usage and input, 130 where it was interrupted (as by Ctrl-C), 1 for anything else.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Input { .. } | Self::File { .. } => 2,
            Self::Interrupted { .. } => 130,
            _ => 1,
        }
    }
}
