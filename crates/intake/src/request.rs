//! Settings of `init`.

use base::error::{Error, InputPlace, Result, Setting};
use record::Control;
use record::table::{TableProposal, TableSettings};
use std::path::PathBuf;

/// Settings of `init` that the caller chooses.
#[derive(Debug, Clone, Default)]
pub struct InitRequest {
    /// Path of the table.
    pub file: PathBuf,
    /// Directory of the new experiment. By default it has the table's name without its extension.
    pub out: Option<PathBuf>,
    /// Properties of the table's columns that the caller knows.
    pub known_columns: TableSettings,
    /// Specimen identifier.
    pub id: Option<String>,
    /// Species of the specimen and region of the eye, in this order. Cohorts form groups by them.
    pub groups: [Option<String>; 2],
    /// Diameter of a spherical robot (mm), diameter of the vitreous (mm) and Poisson's ratio.
    pub sizes: [Option<f64>; 3],
    /// Radius of a spherical tip that is pressed into the gel (µm), and the stiffness of the spring that carries it (N/m).
    pub tip: [Option<f64>; 2],
    /// Length along the force (mm) and cross-section (mm²) of a specimen that is stretched or compressed.
    pub specimen: [Option<f64>; 2],
    /// Density of the robot in kg/m³.
    pub robot_density_kg_m3: Option<f64>,
    /// Noise standard deviation of the measured quantity: of a position in µm, a force in µN, a strain in % or a stress in Pa.
    pub noise: Option<f64>,
    /// Quantity that the experiment commands: the force or the position. `None` to infer it from the table.
    pub control: Option<Control>,
    /// Begin of the load of the first row: `first` for the first row, or a time in s of the table's clock.
    pub load_start: Option<String>,
    /// File that contains the force, if the table does not.
    pub force_file: Option<PathBuf>,
    /// True if an existing experiment may be overwritten.
    pub replace: bool,
}

impl InitRequest {
    /// Time (s) at which the load of the first row began, as the reader counts; `None` if the request does not say so.
    ///
    /// # Errors
    /// [`Error::Input`] for a text that is neither `first` nor a time up to the first row.
    pub(super) fn load_began_s(&self, proposal: &TableProposal) -> Result<Option<f64>> {
        let Some(text) = self.load_start.as_deref() else { return Ok(None) };
        if text == "first" {
            return Ok(Some(proposal.first_time_s));
        }
        let began_s = text.parse::<f64>().ok().map(|time_s| time_s - proposal.clock_zero_s);
        match began_s.filter(|began_s| began_s.is_finite() && *began_s <= proposal.first_time_s) {
            Some(began_s) => Ok(Some(began_s)),
            None => {
                let found = format!(
                    "`{text}` is no time up to the first row, which is at {} s",
                    proposal.first_time_s + proposal.clock_zero_s
                );
                let remedy = "give a time in s of the table's clock, or `first` for the first row";
                Err(Error::input(InputPlace::setting(Setting::LoadStart), found, remedy))
            }
        }
    }

    /// Refuses sizes of a tip or a specimen that are not above 0.
    pub(super) fn refuse_impossible_sizes(&self) -> Result<()> {
        let settings = [
            (Setting::TipRadius, self.tip[0]),
            (Setting::CantileverStiffness, self.tip[1]),
            (Setting::SpecimenLength, self.specimen[0]),
            (Setting::SpecimenArea, self.specimen[1]),
        ];
        let is_impossible = |size: &f64| !(*size > 0.0 && size.is_finite());
        let wrong = settings.into_iter().find_map(|(setting, size)| Some((setting, size.filter(is_impossible)?)));
        wrong.map_or(Ok(()), |(setting, size)| {
            let place = InputPlace::setting(setting);
            Err(Error::input(place, format!("{size} is not above 0"), "give a size above 0"))
        })
    }
}
