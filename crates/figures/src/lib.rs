//! Figures and file formats for results.
//!
//! All functions take plain slices, and no module depends on the sampler or the finite elements. A figure is built as [`svg::Svg`], in which text stays text.
//! The function [`svg::write_figure`] writes it together with a PNG and a PDF. Both are drawn with the embedded font, so they look equal on every machine. Equal input gives equal bytes.
//!
//! Modules that figures share:
//! - [`svg`], [`font`], [`number`] and [`palette`]: drawing, text, numbers and colours
//! - [`axes`], [`ticks`] and [`legend`]: axes and legends
//! - [`density`] and [`contour`]: density estimates and contour lines
//!
//! Each figure has one module:
//! - one posterior or comparison: [`corner`], [`predictive`], [`trace`], [`singular_values`], [`comparison`] with its map and bars, and [`discrepancy`]
//! - oscillations: [`sweep`]
//! - groups of specimens: [`forest`], [`contrasts`] and [`creep_bands`]
//! - whole documents: [`ladder`], [`diagnosis`] and [`calibration`]
//!
//! Draws are written as CSV ([`draws`]) and as NetCDF ([`netcdf`], or [`labelled_netcdf`] for named dimensions).

pub mod axes;
pub mod calibration;
pub mod cohort;
pub mod comparison;
pub mod comparison_bars;
pub mod comparison_map;
pub mod contour;
pub mod contrasts;
pub mod corner;
mod corner_content;
mod corner_draw;
pub mod creep_bands;
pub mod density;
pub mod diagnosis;
pub mod discrepancy;
#[cfg(test)]
mod document_tests;
pub mod draws;
pub mod fingerprints;
mod flags;
pub mod font;
pub mod forest;
#[cfg(test)]
mod group_tests;
pub mod labelled_netcdf;
pub mod labels;
pub mod ladder;
pub mod laws;
#[cfg(test)]
mod layout_tests;
pub mod learned;
pub mod legend;
pub mod netcdf;
mod netcdf_file;
pub mod number;
pub mod page;
pub mod palette;
mod pdf;
pub mod prediction;
pub mod predictions;
pub mod predictive;
pub mod record;
mod record_netcdf;
pub mod robots;
#[cfg(test)]
mod rung_for_tests;
pub mod shapes;
pub mod singular_values;
pub mod svg;
pub mod sweep;
pub mod ticks;
pub mod trace;
