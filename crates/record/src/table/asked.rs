//! Settings that the user gives for a table, and questions that the program asks the user.

/// Settings that the user gives for a table. Settings that are `None` are inferred from the table.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TableSettings {
    /// Columns of time, force, position and cycle, each by name or by number from 1.
    pub columns: [Option<String>; 4],
    /// Column of the frequency of an oscillation, by name or by number from 1.
    pub frequency: Option<String>,
    /// Columns of its two moduli, or of a modulus and the phase or the loss tangent, each by name or by number from 1.
    pub moduli: Option<[String; 2]>,
    /// Columns of x, y and z, if the position is not in a single column.
    pub axes: [Option<String>; 3],
    /// Units of time, force and position.
    pub units: [Option<String>; 3],
    /// Units of the frequency and the moduli of an oscillation.
    pub sweep_units: [Option<String>; 2],
    /// Tables to read from a file that contains several, such as `1,2` or `all`.
    pub tables: Option<String>,
    /// True if every table of the file becomes an experiment of its own.
    pub takes_each_table: bool,
    /// Column that names a tracker's tracks (moving bodies), and the track to read.
    pub track: [Option<String>; 2],
    /// Rule for an empty force cell: `above` (force of the row above) or `zero`.
    pub blank_force: Option<String>,
    /// Thousands separator, or `none`.
    pub thousands: Option<String>,
    /// `join` if a clock that restarts continues from the previous row.
    pub time_restarts: Option<String>,
    /// True if another file contains the force.
    pub force_is_elsewhere: bool,
    /// `spread` if equal times of a coarse clock are spread evenly.
    pub time_ties: Option<String>,
}

/// Question to the user about a choice that the table alone does not determine.
#[derive(Debug, Clone, PartialEq)]
pub struct Question {
    /// Text of the question, without a question mark.
    pub text: String,
    /// Answers that are listed with the question; empty if any answer is allowed.
    pub choices: Vec<String>,
    /// Further allowed answers that are not listed.
    pub also: Vec<String>,
    /// Answer that the program proposes; `None` without a proposal.
    pub proposal: Option<String>,
}

/// Function that asks the user a question and returns the answer; `None` if no user is present.
pub type Ask<'a> = &'a mut dyn FnMut(&Question) -> Option<String>;
