//! What a person should know about how the data were understood.

pub(super) const UM_PER_M: f64 = 1e6;
const NN_PER_N: f64 = 1e9;

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
    /// Positions that the description leaves out.
    PositionsLeftOut {
        /// How many.
        n_left_out: usize,
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
    /// Coordinates were projected on a line, and this is what moved across it.
    MovesAcross {
        /// The coordinates and their line, in words.
        line: String,
        /// Root mean square across it, in m.
        rms_m: f64,
        /// Largest minus smallest position along it, in m.
        range_m: f64,
    },
    /// What is left of an indenter's record, and what was taken off its force.
    Contact {
        /// Time in s of the last row at which the tip is free, with which the record starts.
        from_s: f64,
        /// Of the last row of growing depth, with which it ends.
        to_s: f64,
        /// Of the first row whose position is compared.
        compared_from_s: f64,
        /// Rows left out before.
        n_before: usize,
        /// Rows left out after.
        n_after: usize,
        /// Force on the free tip and its error, in N; `None` where the record begins in contact.
        free_n: Option<[f64; 2]>,
    },
    /// The size of an indenter's tip is not known.
    TipUnknown {
        /// What stands in for it.
        nominal: &'static str,
    },
    /// Where the position is 0 is fitted.
    PositionOffsetFitted,
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
            Self::PositionsLeftOut { n_left_out, n_rows } => write!(
                f,
                "{n_left_out} of {n_rows} positions are left out, as `left_out_s` says; their rows load the model but are not compared"
            ),
            Self::HeldOutCycleEmpty { cycle } => write!(f, "held-out cycle {cycle} has no positions and is not scored"),
            Self::FirstPositionNotZero { position_m } => write!(
                f,
                "the first position is {:.4} µm, but the record should start at 0, before the force acts; subtract the rest position",
                position_m * UM_PER_M
            ),
            Self::MovesAcross { line, rms_m, range_m } => write!(
                f,
                "positions are {line}; along it they range over {:.4} µm, across it they scatter by {:.4} µm (root mean square), which no model sees",
                range_m * UM_PER_M,
                rms_m * UM_PER_M
            ),
            Self::Contact { from_s, to_s, compared_from_s, n_before, n_after, free_n } => {
                let force = match free_n {
                    Some([free_n, error_n]) => format!(
                        "the force on the free tip, {} ± {} nN, is taken off",
                        significant(free_n * NN_PER_N),
                        significant(error_n * NN_PER_N)
                    ),
                    None => "the record begins in contact, so that no force is taken off".into(),
                };
                write!(
                    f,
                    "the contact grows from {from_s:.3} to {to_s:.3} s: {force}; {n_before} rows before and {n_after} after, where the depth falls, are left out, and positions are compared from {compared_from_s:.3} s, where the tip presses; where it meets the gel is fitted (position-offset)"
                )
            }
            Self::TipUnknown { nominal } => write!(
                f,
                "the tip's size is not given, so {nominal} stands in for it: moduli and viscosities hold but for one unknown factor, and what has the unit of a time holds as it is"
            ),
            Self::PositionOffsetFitted => {
                f.write_str("positions count from the first; what is left of their offset is fitted (position-offset)")
            }
            Self::SourceNotStated => f.write_str(
                "`measurement.source` is not given; say there where the data come from, synthetic or measured",
            ),
        }
    }
}

/// Four digits.
fn significant(value: f64) -> String {
    let n_decimals = 3 - if value == 0.0 { 0 } else { value.abs().log10().floor() as i32 };
    format!("{value:.*}", n_decimals.clamp(0, 9) as usize)
}
