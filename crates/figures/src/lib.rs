//! Figures and exchange formats.
//!
//! Everything here takes plain slices: nothing knows the sampler or the finite elements. A figure is built as [`svg::Svg`]
//! (the source of truth; text stays text), and [`svg::write_figure`] stores it beside a PNG rendered from the same
//! document with the embedded font, so that it looks alike on every machine. The same input gives the same bytes.
//!
//! [`svg`], [`font`], [`number`], [`palette`] → [`axes`] and [`ticks`], [`legend`], names of lines → [`density`] and [`contour`] → one file
//! a figure: [`corner`], [`predictive`], [`trace`], [`singular_values`], [`comparison`] with its map and bars, [`discrepancy`], of oscillations [`sweep`]; of groups of
//! specimens [`forest`], [`contrasts`] and [`creep_bands`]; and of a whole document [`ladder`], [`diagnosis`] and [`calibration`]. Draws leave as CSV ([`draws`]) and
//! NetCDF ([`netcdf`], and over named dimensions [`labelled_netcdf`]).

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
