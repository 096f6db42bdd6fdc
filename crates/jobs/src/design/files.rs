//! Files for the controller and for the new record.

use std::path::{Path, PathBuf};

use base::error::Result;
use base::files::{create_folders, to_json, write_together};
use base::toml_input::quoted;
use criticism::protocol::DesignLimits;
use criticism::protocol::design::DesignedProtocol;
use documents::design::{Design, FrontProtocol};
use figures::svg::{Svg, figure_files};
use posterior::study::WithProvenance;
use record::{Apparatus, Experiment, Record};

use crate::prediction::predict::digits;
use crate::simulation_files::description_toml;

/// Directory of the description of the new record.
const RECORD_DIR: &str = "next-record";
const TABLE_NAME: &str = "trajectory.csv";
/// Ending of the name of the new record.
pub const NEXT: &str = "-next";

/// Files of a design in a study.
pub struct DesignFiles {
    study: PathBuf,
    /// Table of the recommended protocol for the controller.
    pub protocol: PathBuf,
    /// Directory of the description of the new record.
    pub record_dir: PathBuf,
}

impl DesignFiles {
    pub fn new(study: &Path) -> Self {
        Self { study: study.into(), protocol: study.join("design-protocol.csv"), record_dir: record_dir(study) }
    }

    /// Table of a protocol of the front, by its number from 0.
    fn of_front(&self, number: usize) -> PathBuf {
        self.study.join(format!("design-front-{}.csv", number + 1))
    }

    /// The recommended protocol among those of other durations, in ascending order of the duration.
    pub fn front(
        &self,
        (limits, best): (&DesignLimits, &DesignedProtocol),
        others: &[(DesignLimits, DesignedProtocol)],
    ) -> Vec<FrontProtocol> {
        let entry = |limits: &DesignLimits, protocol: &DesignedProtocol, file: &Path| FrontProtocol {
            duration_s: limits.duration_s,
            expected_information_nats: protocol.information_nats,
            separation_sigma: protocol.closest.map(|(distance, _)| distance),
            protocol: protocol.drive.described(limits),
            protocol_file: file.display().to_string(),
        };
        let of_other = |(k, (limits, protocol)): (usize, &(DesignLimits, DesignedProtocol))| {
            entry(limits, protocol, &self.of_front(k))
        };
        let mut entries: Vec<FrontProtocol> = others.iter().enumerate().map(of_other).collect();
        entries.push(entry(limits, best, &self.protocol));
        entries.sort_by(|a, b| a.duration_s.total_cmp(&b.duration_s));
        entries
    }

    /// Writes the document, the figure, the tables for the controller, and description and table of the new record. Returns the path of the figure.
    pub fn write(
        &self,
        document: &WithProvenance<Design>,
        figure: &Svg,
        best: &DesignedProtocol,
        others: &[(DesignLimits, DesignedProtocol)],
        (experiment, holds_out): (&Experiment, bool),
    ) -> Result<PathBuf> {
        let is_of_stress = has_stress_and_strain(experiment);
        let (description, table) = next_record(experiment, &best.record, holds_out);
        let json = self.study.join("design.json");
        let json = (json.clone(), to_json(&json, document)?);
        let mut tables = vec![(self.protocol.clone(), protocol_csv(&best.record, is_of_stress))];
        let of_other = |(k, (_, protocol)): (usize, &(DesignLimits, DesignedProtocol))| {
            (self.of_front(k), protocol_csv(&protocol.record, is_of_stress))
        };
        tables.extend(others.iter().enumerate().map(of_other));
        create_folders(&self.record_dir, "check the permissions of the study's directory")?;
        tables.push((self.record_dir.join("experiment.toml"), description));
        tables.push((self.record_dir.join(TABLE_NAME), table));
        let [svg, png, pdf] = figure_files(&self.study, "design", figure)?;
        let written = [&svg, &png, &pdf, &json].into_iter().chain(&tables);
        let written: Vec<_> = written.map(|(path, bytes)| (path.as_path(), bytes.as_slice())).collect();
        write_together(&written)?;
        Ok(svg.0)
    }
}

/// Directory for the description of the new record: the first that does not exist or whose table has no positions yet. A record that was filled in is kept.
fn record_dir(study: &Path) -> PathBuf {
    let numbered = |number: usize| match number {
        1 => study.join(RECORD_DIR),
        _ => study.join(format!("{RECORD_DIR}-{number}")),
    };
    let is_free = |dir: &PathBuf| !dir.exists() || is_unfilled(dir);
    (1..).map(numbered).find(is_free).unwrap_or_else(|| study.join(RECORD_DIR))
}

/// Whether a directory has only the files of a design, with a table without positions.
fn is_unfilled(dir: &Path) -> bool {
    let Ok(entries) = std::fs::read_dir(dir) else { return false };
    let names: Vec<_> = entries.filter_map(|entry| Some(entry.ok()?.file_name())).collect();
    let Ok(table) = std::fs::read_to_string(dir.join(TABLE_NAME)) else { return names.is_empty() };
    names.iter().all(|name| name == TABLE_NAME || name == "experiment.toml")
        && table.lines().skip(1).all(|line| line.split(',').nth(2) == Some(""))
}

/// Whether the record has stress and strain. A stress of 1 Pa then counts as 1 µN, and a strain of 1 % as 1 µm.
fn has_stress_and_strain(experiment: &Experiment) -> bool {
    matches!(experiment.apparatus, Apparatus::Instrument { is_stress_strain: true, .. })
}

/// Columns and units of the new record's table, if they are not a force in µN and a position in µm.
const OF_STRESS_AND_STRAIN: &str = "[measurement.columns]
time = \"time_s\"
force = \"stress_pa\"
position = \"strain_percent\"
cycle = \"cycle\"
[measurement.units]
time = \"s\"
force = \"N\"          # 1 Pa is entered as 1 N
position = \"0.01 m\"  # a strain of 1 is entered as 1 m";

/// Table for the controller. Each force holds until the next row.
fn protocol_csv(record: &Record, is_of_stress: bool) -> Vec<u8> {
    let mut text = format!("time_s,{}\n", if is_of_stress { "stress_pa" } else { "force_un" });
    let last = record.n_rows() - 1;
    for row in 0..=last {
        let is_change = row == 0 || row == last || record.force_n[row] != record.force_n[row - 1];
        if is_change {
            text += &format!("{},{}\n", digits(record.time_s[row]), digits(1e6 * record.force_n[row]));
        }
    }
    text.into_bytes()
}

/// Description and table for the new record, with the same apparatus. The positions are missing. The last third is a cycle of its own if it is held out.
fn next_record(experiment: &Experiment, record: &Record, holds_out: bool) -> (Vec<u8>, Vec<u8>) {
    let mut measurement = vec![
        "calibration_cycles = [1]".to_string(),
        format!("heldout_cycles = [{}]", if holds_out { "2" } else { "" }),
        format!("force = \"{}\"", record.force_rule.name()),
        format!("source = {}", quoted("to be recorded: protocol of vitreo-uq design")),
    ];
    measurement.extend(experiment.fits_position_offset.then(|| "zero = \"fit\"".to_string()));
    let noise = experiment.quantities().map_or("noise_um".into(), |quantities| quantities.key("noise_um"));
    measurement.extend(experiment.noise_sd_m.map(|sd_m| format!("{noise} = {}", 1e6 * sd_m)));
    let is_of_stress = has_stress_and_strain(experiment);
    measurement.extend(is_of_stress.then(|| OF_STRESS_AND_STRAIN.to_string()));
    let columns = if is_of_stress { ["stress_pa", "strain_percent"] } else { ["force_uN", "position_um"] };
    let head = &format!(
        "# Protocol of `vitreo-uq design`. Replace trajectory.csv by the record, or fill in its column {}.",
        columns[1]
    );
    let toml = description_toml(head, &format!("{}{NEXT}", experiment.specimen_id), experiment, &measurement);
    let mut table = format!("time_s,{},cycle\n", columns.join(","));
    let last = record.n_rows() - 1;
    for row in 0..=last {
        let cycle = if holds_out && 3 * row >= 2 * last { 2 } else { 1 };
        table += &format!("{},{},,{cycle}\n", digits(record.time_s[row]), digits(1e6 * record.force_n[row]));
    }
    (toml.into_bytes(), table.into_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;
    use posterior::replica::embedded;

    /// A new record on an apparatus with an unknown zero has one of its own.
    #[test]
    fn the_next_record_keeps_a_fitted_zero() {
        let (mut experiment, _) = embedded().expect("embedded");
        for fits in [false, true] {
            experiment.fits_position_offset = fits;
            let (toml, _) = next_record(&experiment, &experiment.record, false);
            assert_eq!(String::from_utf8(toml).expect("text").contains("zero = \"fit\""), fits);
        }
    }
}
