//! What vitreo-uq writes for people and programs: documents as plain types, figures, CSV and NetCDF.

pub mod documents;
pub mod page;
pub mod report;

use vitreo_uq_mechanics::{Error, Result, effects, error, files, parameter, rheology};
