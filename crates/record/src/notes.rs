//! Notes to the user on the data and on how they were read.

const UM_PER_M: f64 = 1e6;
const NN_PER_N: f64 = 1e9;

/// Remark to the user on the data or on how they were read, which is not an error.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Note {
    /// The record has no cycle column, and cycles were found from the force's repetition.
    CyclesFound {
        /// Number of cycles, including an incomplete last one.
        n_cycles: u32,
        /// Median time in s between the starts of successive cycles; `None` if the force does not repeat.
        period_s: Option<f64>,
        /// Description of the repetition and its irregularities.
        text: String,
    },
    /// Some rows have no position.
    PositionsMissing {
        /// Number of rows without a position.
        n_missing: usize,
        /// Total number of rows.
        n_rows: usize,
    },
    /// The key `left_out_s` of the description excludes some positions.
    PositionsLeftOut {
        /// Number of positions excluded.
        n_left_out: usize,
        /// Total number of rows.
        n_rows: usize,
    },
    /// A held-out cycle has no positions, so it cannot be scored.
    HeldOutCycleEmpty {
        /// Number of the cycle.
        cycle: u32,
    },
    /// The first position is far from 0, although the record should start there.
    FirstPositionNotZero {
        /// First position of the record, in m.
        position_m: f64,
    },
    /// Coordinates were projected onto a line. The note also tells how far the bead moved across this line.
    MovesAcross {
        /// Text that names the coordinates and the direction of their line.
        line: String,
        /// Root mean square motion across the line, in m.
        rms_m: f64,
        /// Largest minus smallest position along the line, in m.
        range_m: f64,
    },
    /// An indenter's record was reduced to the rows with growing contact, and the force on the free tip was subtracted.
    Contact {
        /// Time in s at which the used record starts, at the last row with a free tip.
        from_s: f64,
        /// Time in s at which the used record ends, at the last row with growing depth.
        to_s: f64,
        /// Time in s of the first row whose position is compared with the model.
        compared_from_s: f64,
        /// Number of rows excluded before the used record.
        n_before: usize,
        /// Number of rows excluded after the used record.
        n_after: usize,
        /// Force on the free tip and its error, in N; `None` if the record begins in contact.
        free_n: Option<[f64; 2]>,
    },
    /// The size of an indenter's tip is unknown.
    TipUnknown {
        /// Nominal size that is assumed, as a text.
        nominal: &'static str,
    },
    /// The zero of the positions is unknown and is fitted.
    PositionOffsetFitted,
    /// The key `measurement.source` is missing.
    SourceNotStated,
}

impl std::fmt::Display for Note {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::CyclesFound { text, .. } => f.write_str(text),
            Self::PositionsMissing { n_missing, n_rows } => {
                write!(
                    f,
                    "{n_missing} of {n_rows} rows have no position; their forces act, but the model is not compared with them"
                )
            }
            Self::PositionsLeftOut { n_left_out, n_rows } => write!(
                f,
                "{n_left_out} of {n_rows} positions are left out by `left_out_s`; the forces of their rows still act"
            ),
            Self::HeldOutCycleEmpty { cycle } => write!(f, "held-out cycle {cycle} has no positions and is not scored"),
            Self::FirstPositionNotZero { position_m } => write!(
                f,
                "the first position is {:.4} µm, but the record should start at 0 before the force acts: give `load_start_s` if the load began before the first row; otherwise subtract the rest position",
                position_m * UM_PER_M
            ),
            Self::MovesAcross { line, rms_m, range_m } => write!(
                f,
                "positions are {line}; they range over {:.4} µm along the line and vary by {:.4} µm (root mean square) across the line; no model uses the motion across the line",
                range_m * UM_PER_M,
                rms_m * UM_PER_M
            ),
            Self::Contact { from_s, to_s, compared_from_s, n_before, n_after, free_n } => {
                let force = match free_n {
                    Some([free_n, error_n]) => format!(
                        "the free tip's force of {} ± {} nN is subtracted",
                        significant(free_n * NN_PER_N),
                        significant(error_n * NN_PER_N)
                    ),
                    None => "the record begins in contact, so no force is subtracted".into(),
                };
                write!(
                    f,
                    "the contact grows from {from_s:.3} to {to_s:.3} s, and {force}; {n_before} rows before contact and {n_after} rows of falling depth after it are left out; positions are compared from {compared_from_s:.3} s, where the tip presses; the contact point is fitted (position-offset)"
                )
            }
            Self::TipUnknown { nominal } => write!(
                f,
                "the tip's size is not given and {nominal} is assumed: moduli and viscosities contain one unknown common factor, but times are right"
            ),
            Self::PositionOffsetFitted => f.write_str(
                "positions count from the first one, and their remaining offset is fitted (position-offset)",
            ),
            Self::SourceNotStated => {
                f.write_str("`measurement.source` is not given; state if the data are synthetic or measured")
            }
        }
    }
}

/// Formats a value with four significant digits.
fn significant(value: f64) -> String {
    let n_decimals = 3 - if value == 0.0 { 0 } else { value.abs().log10().floor() as i32 };
    format!("{value:.*}", n_decimals.clamp(0, 9) as usize)
}
