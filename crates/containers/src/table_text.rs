//! Text of tables: titles, headers and rows, with tabs between cells.

/// Text of the tables in a container, and notes on contents that it lacks.
#[derive(Debug, Default)]
pub struct TableText {
    /// The tables. Each begins with an empty line and its title.
    pub text: String,
    /// Contents of the container that are not in the text.
    pub notes: Vec<String>,
}

impl TableText {
    /// Begins a table.
    pub fn title(&mut self, title: &str) {
        if !self.text.is_empty() {
            self.text.push('\n');
        }
        self.text.push_str(&plain(title));
        self.text.push('\n');
    }

    /// Adds a line of cells.
    pub fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        for (place, cell) in cells.into_iter().enumerate() {
            if place > 0 {
                self.text.push('\t');
            }
            self.text.push_str(&plain(&cell));
        }
        self.text.push('\n');
    }
}

/// Text of a cell without characters that would change the layout of the table. A double prime, as in G", becomes two apostrophes.
fn plain(cell: &str) -> String {
    cell.trim().replace('"', "''").replace(char::is_control, " ")
}

/// Largest whole number that is written without an exponent or decimals.
const LARGEST_WHOLE: f64 = 1e15;

/// Text of a number that gives the same number when it is read. A value that is not finite becomes an empty cell, which means a lost position.
pub fn number(value: f64) -> String {
    match value {
        _ if !value.is_finite() => String::new(),
        // Numbers of cycles and tracks are whole numbers. A zero has no sign.
        _ if value.fract() == 0.0 && value.abs() < LARGEST_WHOLE => format!("{}", value as i64),
        _ => format!("{value:?}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_keep_their_places() {
        let mut table = TableText::default();
        table.title("Sheet\t1");
        table.row(["", "a\nb", "12\" disc", ""].map(String::from));
        table.row([0.1 + 0.2, f64::NAN, -1e-30, -0.0, 3.0, 1e16].map(number));
        assert_eq!(table.text, "Sheet 1\n\ta b\t12'' disc\t\n0.30000000000000004\t\t-1e-30\t0\t3\t1e16\n");
    }
}
