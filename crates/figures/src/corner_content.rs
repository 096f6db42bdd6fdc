//! What a corner plot shows.

use super::density::Support;
use super::palette::Colour;
use super::ticks::Scale;

/// Fewest draws from which contours are estimated; below, the draws alone are shown.
pub const FEWEST_DRAWS_FOR_CONTOURS: usize = 50;

/// A prior density on a grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PriorCurve<'a> {
    /// Parameter values, ascending.
    pub x: &'a [f64],
    /// Normalised density there, in the inverse unit of `x`.
    pub density: &'a [f64],
}

/// The draws of one parameter.
#[derive(Debug, Clone, Copy)]
pub struct ParameterColumn<'a> {
    /// Name by which posteriors are matched, such as `young_modulus_pa`.
    pub name: &'a str,
    /// Short symbol, such as `E`.
    pub symbol: &'a str,
    /// Unit, such as `Pa`; empty or `–` for none.
    pub unit: &'a str,
    /// Draws, as many for every parameter of a posterior.
    pub draws: &'a [f64],
    /// Hard limits of the parameter.
    pub support: Support,
    /// Prior density, drawn dashed.
    pub prior: Option<PriorCurve<'a>>,
    /// Value to compare with, such as a published one.
    pub reference: Option<f64>,
}

/// One posterior.
#[derive(Debug, Clone)]
pub struct Posterior<'a> {
    /// What the legend calls it.
    pub label: &'a str,
    /// Its colour; see [`super::palette::series`].
    pub colour: Colour,
    /// Its parameters.
    pub parameters: Vec<ParameterColumn<'a>>,
}

/// What is shown beside the draws.
#[derive(Debug, Clone)]
pub struct CornerOptions<'a> {
    /// Title; empty for none.
    pub title: &'a str,
    /// Probabilities that contours enclose, each between 0 and 1.
    pub masses: &'a [f64],
    /// What the reference values are, for the legend.
    pub reference_label: &'a str,
}

impl Default for CornerOptions<'_> {
    fn default() -> Self {
        Self { title: "", masses: &[0.5, 0.9], reference_label: "reference" }
    }
}

/// A parameter's row and column: what all posteriors that have it share.
#[derive(Debug)]
pub(super) struct Slot<'a> {
    pub(super) label: String,
    pub(super) symbol: &'a str,
    pub(super) unit: &'a str,
    pub(super) scale: Scale,
    pub(super) reference: Option<f64>,
    /// Index into the parameters of each posterior.
    pub(super) columns: Vec<Option<usize>>,
}

/// What the panels are drawn from.
pub(super) struct Content<'a> {
    pub(super) slots: Vec<Slot<'a>>,
    pub(super) posteriors: &'a [Posterior<'a>],
    /// Ascending draws of each posterior's parameters.
    pub(super) ascending: Vec<Vec<Vec<f64>>>,
    pub(super) options: &'a CornerOptions<'a>,
}
