//! Figures and exchange formats.
//!
//! All functions take plain slices, and no module depends on the sampler or the finite elements. A figure is built as [`svg::Svg`],
//! in which text stays text. [`svg::write_figure`] stores it beside a PNG that is rendered from the same
//! document with the embedded font, so that it looks equal on every machine. Equal input gives equal bytes.
//!
//! Basic modules: [`svg`], [`font`], [`number`], [`palette`] → [`axes`] and [`ticks`], [`legend`], names of lines → [`density`] and [`contour`]. Each figure has
//! one module: [`corner`], [`predictive`], [`trace`], [`singular_values`], [`comparison`] with its map and bars, [`discrepancy`]; oscillations: [`sweep`]; groups of
//! specimens: [`forest`], [`contrasts`] and [`creep_bands`]; whole documents: [`ladder`], [`diagnosis`] and [`calibration`]. Draws are written as CSV ([`draws`]) and
//! NetCDF ([`netcdf`], or [`labelled_netcdf`] for named dimensions).

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
#[cfg(test)]
mod layout_tests;
pub mod learned;
pub mod legend;
pub mod netcdf;
mod netcdf_file;
pub mod number;
pub mod page;
pub mod palette;
pub mod predictions;
pub mod predictive;
pub mod record;
mod record_netcdf;
#[cfg(test)]
mod rung_for_tests;
pub mod shapes;
pub mod singular_values;
pub mod svg;
pub mod sweep;
pub mod ticks;
pub mod trace;
