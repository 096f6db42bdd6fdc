//! Content of a corner plot: posteriors, their parameters, and settings.

use super::density::Support;
use super::palette::Colour;
use super::ticks::AxisScale;

/// Minimum number of draws for contours. With fewer draws, only dots are shown.
pub const FEWEST_DRAWS_FOR_CONTOURS: usize = 50;

/// Prior density of a parameter, as values on a grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PriorCurve<'a> {
    /// Parameter values on the grid, ascending.
    pub x: &'a [f64],
    /// Prior density at the values `x`, in the inverse unit of `x`. Its integral is 1.
    pub density: &'a [f64],
}

/// Draws of one parameter from one posterior.
#[derive(Debug, Clone, Copy)]
pub struct ParameterColumn<'a> {
    /// Name of the parameter, such as `young_modulus_pa`. Parameters of different posteriors share a panel if their names are equal.
    pub name: &'a str,
    /// Short symbol of the parameter, such as `E`.
    pub symbol: &'a str,
    /// Unit of the parameter, such as `Pa`; empty or `–` for none.
    pub unit: &'a str,
    /// Values of the draws. All parameters of a posterior have the same number of draws.
    pub draws: &'a [f64],
    /// Hard limits of the parameter's values.
    pub support: Support,
    /// Prior density, drawn as a dashed line; `None` if it is unknown.
    pub prior: Option<PriorCurve<'a>>,
    /// Value for comparison, such as a published value; `None` for none.
    pub reference: Option<f64>,
}

/// One posterior of a corner plot.
#[derive(Debug, Clone)]
pub struct Posterior<'a> {
    /// Name of the posterior in the legend.
    pub label: &'a str,
    /// Colour of the posterior; see [`super::palette::series`].
    pub colour: Colour,
    /// Parameters with their draws.
    pub parameters: Vec<ParameterColumn<'a>>,
}

/// Settings of a corner plot.
#[derive(Debug, Clone)]
pub struct CornerOptions<'a> {
    /// Title of the figure; empty for none.
    pub title: &'a str,
    /// Fractions of the draws that contours enclose, each between 0 and 1.
    pub masses: &'a [f64],
    /// Text for the reference values in the legend.
    pub reference_label: &'a str,
}

impl Default for CornerOptions<'_> {
    fn default() -> Self {
        Self { title: "", masses: &[0.5, 0.9], reference_label: "reference" }
    }
}

/// Row and column of a corner plot that belong to one parameter. All posteriors with this parameter share it.
#[derive(Debug)]
pub(super) struct Slot<'a> {
    pub(super) label: String,
    pub(super) symbol: &'a str,
    pub(super) unit: &'a str,
    pub(super) scale: AxisScale,
    pub(super) reference: Option<f64>,
    /// Index of this parameter in each posterior; `None` for posteriors without it.
    pub(super) columns: Vec<Option<usize>>,
}

/// Data that all panels of a corner plot use.
pub(super) struct Content<'a> {
    pub(super) slots: Vec<Slot<'a>>,
    pub(super) posteriors: &'a [Posterior<'a>],
    /// Draws in ascending order, indexed by posterior and parameter.
    pub(super) ascending: Vec<Vec<Vec<f64>>>,
    pub(super) options: &'a CornerOptions<'a>,
}
