//! What a person should know about how the data were understood.

pub(super) const UM_PER_M: f64 = 1e6;

/// Something noticed while reading that is not an error.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Note {
    /// Cycles were found from the force's repetition.
    CyclesFound {
        /// Number of cycles, an incomplete last one included.
        n_cycles: u32,
        /// Median time in s from the start of a cycle to the next; `None` for a single cycle.
        period_s: Option<f64>,
        /// In words: by which repetition, and what is unusual about it.
        text: String,
    },
    /// Rows without a position.
    PositionsMissing {
        /// How many.
        n_missing: usize,
        /// Of how many rows.
        n_rows: usize,
    },
    /// A held-out cycle holds no position at all, so it cannot be scored.
    HeldOutCycleEmpty {
        /// The cycle.
        cycle: u32,
    },
    /// The first position is far from 0, where the record should start.
    FirstPositionNotZero {
        /// The first position in m.
        position_m: f64,
    },
    /// x and y were projected on a line, and this is what moved across it.
    MovesAcross {
        /// Direction of the line, from x towards y.
        degrees: f64,
        /// Root mean square across it, in m.
        rms_m: f64,
        /// Largest minus smallest position along it, in m.
        range_m: f64,
    },
    /// `measurement.source` was left out.
    SourceNotStated,
}

impl std::fmt::Display for Note {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::CyclesFound { text, .. } => f.write_str(text),
            Self::PositionsMissing { n_missing, n_rows } => {
                write!(f, "{n_missing} of {n_rows} rows have no position; they load the model but are not compared")
            }
            Self::HeldOutCycleEmpty { cycle } => write!(f, "held-out cycle {cycle} has no positions and is not scored"),
            Self::FirstPositionNotZero { position_m } => write!(
                f,
                "the first position is {:.4} µm, but the record should start at 0, before the force acts; subtract the rest position",
                position_m * UM_PER_M
            ),
            Self::MovesAcross { degrees, rms_m, range_m } => write!(
                f,
                "x and y are projected on a line at {degrees:.2}° from x; along it positions range over {:.4} µm, across it they scatter by {:.4} µm (root mean square), which no model sees",
                range_m * UM_PER_M,
                rms_m * UM_PER_M
            ),
            Self::SourceNotStated => f.write_str(
                "`measurement.source` is not given; say there where the data come from, synthetic or measured",
            ),
        }
    }
}
