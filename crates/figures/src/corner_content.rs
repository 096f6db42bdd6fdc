//! Content of a corner plot.

use super::density::Support;
use super::palette::Colour;
use super::ticks::AxisScale;

/// Minimum number of draws for contours; with fewer, only the draws are shown.
pub const FEWEST_DRAWS_FOR_CONTOURS: usize = 50;

/// Prior density on a grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PriorCurve<'a> {
    /// Parameter values, ascending.
    pub x: &'a [f64],
    /// Normalised density at these values, in the inverse unit of `x`.
    pub density: &'a [f64],
}

/// Draws of one parameter.
#[derive(Debug, Clone, Copy)]
pub struct ParameterColumn<'a> {
    /// Name by which posteriors are matched, such as `young_modulus_pa`.
    pub name: &'a str,
    /// Short symbol, such as `E`.
    pub symbol: &'a str,
    /// Unit, such as `Pa`; empty or `–` for none.
    pub unit: &'a str,
    /// Draws; the number is the same for all parameters of a posterior.
    pub draws: &'a [f64],
    /// Hard limits of the parameter.
    pub support: Support,
    /// Prior density, drawn dashed.
    pub prior: Option<PriorCurve<'a>>,
    /// Value to compare with, such as a published value.
    pub reference: Option<f64>,
}

/// One posterior.
#[derive(Debug, Clone)]
pub struct Posterior<'a> {
    /// Legend text.
    pub label: &'a str,
    /// Colour; see [`super::palette::series`].
    pub colour: Colour,
    /// Parameters with their draws.
    pub parameters: Vec<ParameterColumn<'a>>,
}

/// Settings of a corner plot.
#[derive(Debug, Clone)]
pub struct CornerOptions<'a> {
    /// Title; empty for none.
    pub title: &'a str,
    /// Probabilities that contours enclose, each between 0 and 1.
    pub masses: &'a [f64],
    /// Legend text of the reference values.
    pub reference_label: &'a str,
}

impl Default for CornerOptions<'_> {
    fn default() -> Self {
        Self { title: "", masses: &[0.5, 0.9], reference_label: "reference" }
    }
}

/// Row and column of a parameter, common to all posteriors that have it.
#[derive(Debug)]
pub(super) struct Slot<'a> {
    pub(super) label: String,
    pub(super) symbol: &'a str,
    pub(super) unit: &'a str,
    pub(super) scale: AxisScale,
    pub(super) reference: Option<f64>,
    /// Index into the parameters of each posterior.
    pub(super) columns: Vec<Option<usize>>,
}

/// Data of all panels.
pub(super) struct Content<'a> {
    pub(super) slots: Vec<Slot<'a>>,
    pub(super) posteriors: &'a [Posterior<'a>],
    /// Ascending draws of each posterior's parameters.
    pub(super) ascending: Vec<Vec<Vec<f64>>>,
    pub(super) options: &'a CornerOptions<'a>,
}
