//! `init` for a rheometer's creep test: stress is read as the force, and strain as the position (docs/experiment.md).

use base::error::Setting;
use base::units::Dimension;
use record::table::{InspectedTable, TableSettings};

/// Words by which the stress column is recognised.
const STRESS: [&str; 3] = ["stress", "spannung", "contrainte"];
/// Words by which the strain column is recognised.
const STRAIN: [&str; 4] = ["strain", "deformation", "dehnung", "déformation"];
/// Word that excludes a column: a column of rates is neither stress nor strain.
const RATE: &str = "rate";
/// Poisson's ratio of a specimen that is nearly all water.
const OF_WATER: f64 = 0.5;

/// Creep test of a rheometer in shear.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct RheometerCreep {
    /// Columns to read, with units. A stress of 1 Pa is read as a force of 1 N, and a strain of 1 as a position of 1 m.
    pub given: TableSettings,
    /// Shear strain divided by shear stress at a creep compliance of 1/Pa: 2 + 2ν, where ν is Poisson's ratio.
    pub compliance: f64,
}

impl RheometerCreep {
    /// Finds the stress and strain columns of a table; `None` if it does not have both.
    pub fn of(looked: &InspectedTable, given: &TableSettings, poisson_ratio: Option<f64>) -> Option<Self> {
        if given.columns.iter().chain(&given.axes).any(Option::is_some) {
            return None;
        }
        let columns = || looked.columns.iter().zip(&looked.units).enumerate();
        let called = |name: &str, words: &[&str]| {
            let name = name.to_lowercase();
            words.iter().any(|word| name.contains(word)) && !name.contains(RATE)
        };
        let (stress, pascals) = columns().find_map(|(place, (name, unit))| {
            let unit = unit.as_ref().filter(|unit| unit.dimension == Dimension::Pressure)?;
            called(name, &STRESS).then(|| (place, unit.to_si(1.0)))
        })?;
        let (strain, part) = columns().find_map(|(place, (name, unit))| {
            let part = match unit {
                None => 1.0,
                Some(unit) if unit.dimension == Dimension::Ratio => unit.to_si(1.0),
                Some(_) => return None,
            };
            called(name, &STRAIN).then_some((place, part))
        })?;
        let number = |place: usize| Some((place + 1).to_string());
        let so_many = |many: f64, of: &str| Some(if many == 1.0 { of.to_string() } else { format!("{many} {of}") });
        Some(Self {
            given: TableSettings {
                columns: [None, number(stress), number(strain), None],
                units: [given.units[0].clone(), so_many(pascals, "N"), so_many(part, "m")],
                ..given.clone()
            },
            compliance: 2.0 + 2.0 * poisson_ratio.unwrap_or(OF_WATER),
        })
    }

    /// Explains why the table is read as a creep test.
    pub fn reason(&self) -> String {
        format!(
            "stress and strain over time: a rheometer's creep test. 1 Pa is entered as 1 N and a strain of 1 as 1 m, with compliance_per_m = {} = 2 + 2ν. Use `{} generic` for a gel other than vitreous humour",
            self.compliance,
            Setting::Prior
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use record::table::inspect_table;

    fn creep(header: &str, poisson_ratio: Option<f64>) -> Option<RheometerCreep> {
        let text = format!("{header}\n0,0,1\n1,5,1\n2,6,1\n");
        let looked = inspect_table("creep.csv".as_ref(), text.as_bytes()).expect("a table");
        RheometerCreep::of(&looked, &TableSettings::default(), poisson_ratio)
    }

    #[test]
    fn stress_and_strain_are_a_creep_in_their_units() {
        let found = creep("Time [s],Shear strain [%],Shear stress [kPa]", Some(0.48)).expect("a creep");
        assert_eq!(found.given.columns, [None, Some("3".into()), Some("2".into()), None]);
        assert_eq!(found.given.units, [None, Some("1000 N".into()), Some("0.01 m".into())]);
        assert!((found.compliance - 2.96).abs() < 1e-12);
        let plain = creep("Zeit in s,Dehnung,Spannung in Pa", None).expect("a creep");
        assert_eq!(plain.given.units, [None, Some("N".into()), Some("m".into())]);
        assert_eq!(plain.compliance, 3.0);
    }

    #[test]
    fn other_tables_are_none() {
        for header in
            ["Time [s],Position [um],Force [uN]", "Time [s],Strain rate [%],Stress [Pa]", "t_s,strain_um,stress_Pa"]
        {
            assert_eq!(creep(header, None), None, "{header}");
        }
    }
}
