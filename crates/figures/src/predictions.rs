//! Predictions of a revision for every row, as a CSV table. The table contains the numbers that the predictive figure shows.

use std::path::Path;

use base::error::{Error, InputPlace, Result};
use base::files::{self, Content, stream_atomically};

/// Names of the columns of quantiles, from the lowest to the highest.
const QUANTILES: [&str; 5] = ["q05_um", "q25_um", "median_um", "q75_um", "q95_um"];

/// Predicted positions of a record's rows, including noise.
#[derive(Debug, Clone, PartialEq)]
pub struct Predictions {
    /// Time of each row, in s.
    pub time_s: Vec<f64>,
    /// Quantiles 0.05, 0.25, 0.5, 0.75 and 0.95 of the position, in µm. Each list has one value per row.
    pub quantiles_um: [Vec<f64>; 5],
}

/// Writes predictions as a CSV file.
///
/// # Errors
/// [`Error::File`] if the file cannot be written.
pub fn write_predictions(path: &Path, predictions: &Predictions) -> Result<()> {
    stream_atomically(path, |out| {
        writeln!(out, "time_s,{}", QUANTILES.join(","))?;
        for (row, time_s) in predictions.time_s.iter().enumerate() {
            write!(out, "{time_s:?}")?;
            for quantile in &predictions.quantiles_um {
                // Six decimals of a µm are sufficient: a thousandth of a nanometre is far below the resolution of any tracker.
                write!(out, ",{:.6}", quantile[row])?;
            }
            writeln!(out)?;
        }
        Ok(())
    })
}

/// Reads a CSV file that [`write_predictions`] has written.
///
/// # Errors
/// [`Error::Input`] with the line that is not a valid row.
pub fn read_predictions(path: &Path) -> Result<Predictions> {
    let again = "run the command again that wrote the file";
    let bytes = files::read(path, Content::Table, again)?;
    let refused =
        |line: usize| Error::input(InputPlace::file(path).at_line(line), "this is not a row of predictions", again);
    let mut predictions = Predictions { time_s: Vec::new(), quantiles_um: Default::default() };
    let mut rows = csv::Reader::from_reader(bytes.as_slice());
    for (row, record) in rows.deserialize::<(f64, [f64; 5])>().enumerate() {
        let (time_s, quantiles) = record.map_err(|_| refused(row + 2))?;
        predictions.time_s.push(time_s);
        predictions.quantiles_um.iter_mut().zip(quantiles).for_each(|(column, value)| column.push(value));
    }
    Ok(predictions)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("predictions.csv");
        let quantiles_um = std::array::from_fn(|k| vec![k as f64, 0.25 - k as f64, 1234.5]);
        let written = Predictions { time_s: vec![0.0, 0.05, 0.1], quantiles_um };
        write_predictions(&path, &written).unwrap();
        assert_eq!(read_predictions(&path).unwrap(), written);
        std::fs::write(&path, "time_s,q05_um\n0,1\n").unwrap();
        assert!(read_predictions(&path).unwrap_err().to_string().contains("line 2"));
    }
}
