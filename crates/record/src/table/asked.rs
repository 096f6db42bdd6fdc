//! What is known of a table, and questions to whoever knows more.

/// What the user says of a table; whatever is missing is found.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Given {
    /// Columns of time, force, position and cycle, by name or number.
    pub columns: [Option<String>; 4],
    /// Columns of x, y and z, where the position is not in one column.
    pub axes: [Option<String>; 3],
    /// Units of time, force and position.
    pub units: [Option<String>; 3],
    /// The tables of a file that holds several, such as `1,2`, or `all`.
    pub tables: Option<String>,
    /// Column of a tracker's tracks, and the track that is read.
    pub track: [Option<String>; 2],
    /// What a blank force stands for: `above` or `zero`.
    pub blank_force: Option<String>,
    /// The sign between thousands, or `none`.
    pub thousands: Option<String>,
    /// `join` where times that begin again go on.
    pub time_restarts: Option<String>,
    /// `spread` where equal times are spread over a clock's steps.
    pub time_ties: Option<String>,
}

/// What a table does not say, for whoever can.
#[derive(Debug, Clone, PartialEq)]
pub struct Question {
    /// What is asked for, without a question mark.
    pub text: String,
    /// What may be answered; empty where anything may.
    pub choices: Vec<String>,
    /// What may be answered, too, without being listed.
    pub also: Vec<String>,
    /// What is proposed.
    pub proposal: Option<String>,
}

/// Gives the answer to a question, or `None` where nobody is there.
pub type Ask<'a> = &'a mut dyn FnMut(&Question) -> Option<String>;
