//! The user's settings for a table, and questions to the user.

/// The user's settings for a table. Missing settings are inferred from the table.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TableSettings {
    /// Columns of time, force, position and cycle, by name or number.
    pub columns: [Option<String>; 4],
    /// Columns of x, y and z, if the position is not in a single column.
    pub axes: [Option<String>; 3],
    /// Units of time, force and position.
    pub units: [Option<String>; 3],
    /// Tables to read from a file with several, such as `1,2` or `all`.
    pub tables: Option<String>,
    /// Column of a tracker's tracks, and the track to read.
    pub track: [Option<String>; 2],
    /// Meaning of a blank force: `above` or `zero`.
    pub blank_force: Option<String>,
    /// Thousands separator, or `none`.
    pub thousands: Option<String>,
    /// `join` if times that restart continue.
    pub time_restarts: Option<String>,
    /// `spread` if equal times are spread over a clock's steps.
    pub time_ties: Option<String>,
}

/// A question about a table that the table does not answer.
#[derive(Debug, Clone, PartialEq)]
pub struct Question {
    /// Text of the question, without a question mark.
    pub text: String,
    /// Possible answers; empty if any answer is allowed.
    pub choices: Vec<String>,
    /// Further possible answers that are not listed.
    pub also: Vec<String>,
    /// Proposed answer.
    pub proposal: Option<String>,
}

/// Answers a question, or returns `None` if no user is present.
pub type Ask<'a> = &'a mut dyn FnMut(&Question) -> Option<String>;
