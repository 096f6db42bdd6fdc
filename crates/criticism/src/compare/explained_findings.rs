//! Findings that another finding explains.
//!
//! One missing effect makes a model deviate in several tests at once: time since a step, velocity, position and more. The finding with the largest gain, relative to its
//! mean in noise, leads. The primary test leads instead if it gains at least half of the largest gain, because it shows the time course. The leading finding is a source.
//! A source explains another finding if its bias, once in the model, removes more than half of that finding's gain or makes that finding insignificant.

use super::calibration::{Significance, TestStatistics};
use super::linear::Linear;
use base::error::Result;
use posterior::noise::NoiseLikelihood;
use posterior::patterns::rows::Columns;
use posterior::whiteness::{ljung_box, runs};

/// Largest fraction of its gain that an explained finding keeps once the bias of another finding (its source) is in the model.
const EXPLAINED_FRACTION: f64 = 0.5;
/// Fraction of the largest gain above which the primary test (correlation of residuals with force changes) leads.
const SHARE_OF_PRIMARY: f64 = 0.5;

/// A finding and the finding that explains it, each given by the index of its statistic.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RankedFinding {
    /// Index of the statistic in [`TestStatistics::statistics`].
    pub statistic: usize,
    /// Index of the statistic that explains this one.
    pub explained_by: Option<usize>,
}

/// Test results of a record, and the panels' columns.
pub struct RecordResults<'a> {
    /// The model, linearised around its fit.
    pub linear: &'a Linear,
    /// Likelihood of the record.
    pub likelihood: &'a NoiseLikelihood,
    /// Measured minus predicted positions (m), one value per row.
    pub residual_m: &'a [f64],
    /// Columns of each panel.
    pub columns: &'a [Columns],
    /// Index of the primary test, the correlation of residuals with force changes.
    pub primary: Option<usize>,
    /// Statistics and fits of all tests.
    pub looks: &'a TestStatistics,
}

/// Orders findings: first those that no other finding explains, then the explained ones. Each group is ordered by the ratio of the gain to its mean in noise. In each
/// group, a strong primary test comes first, and the tests of whiteness come last.
///
/// # Errors
/// Errors of [`Linear::fit_base`].
pub fn order_findings(
    shown: &RecordResults,
    significant: &[usize],
    significance: &Significance,
) -> Result<Vec<RankedFinding>> {
    let gains = &shown.looks.statistics;
    // Tests of whiteness concern no particular place in the record. They come after all panels.
    let is_whiteness = |look: &usize| *look >= shown.columns.len();
    let largest =
        significant.iter().filter(|look| !is_whiteness(look)).fold(0.0, |most: f64, look| most.max(gains[*look]));
    let is_leading = |look: &usize| shown.primary == Some(*look) && gains[*look] > SHARE_OF_PRIMARY * largest;
    let strength = |look: &usize| gains[*look] / significance.mean[*look].max(f64::MIN_POSITIVE);
    let class = |look: &usize| (is_whiteness(look), !is_leading(look));
    let mut order = significant.to_vec();
    order.sort_by(|a, b| class(a).cmp(&class(b)).then(strength(b).total_cmp(&strength(a))));
    let (mut sources, mut echoes): (Vec<RankedFinding>, Vec<RankedFinding>) = (Vec::new(), Vec::new());
    for look in order {
        let least = significance.critical[look].max(EXPLAINED_FRACTION * gains[look]);
        let mut echo_of = None;
        for source in sources.iter().filter(|source| !is_whiteness(&source.statistic)) {
            if shown.remaining_gain(look, source.statistic)? < least {
                echo_of = Some(source.statistic);
                break;
            }
        }
        let list = if echo_of.is_none() { &mut sources } else { &mut echoes };
        list.push(RankedFinding { statistic: look, explained_by: echo_of });
    }
    sources.extend(echoes);
    Ok(sources)
}

impl RecordResults<'_> {
    /// Returns the remaining gain (nats) of the test `look` once the columns of the panel `source` are in the model.
    fn remaining_gain(&self, look: usize, source: usize) -> Result<f64> {
        let there = &self.looks.panel_fits[source];
        let Some(columns) = self.columns.get(look) else {
            let whitened = self.linear.whitened(self.likelihood, self.residual_m, there);
            return Ok(if look == self.columns.len() { runs(&whitened) } else { ljung_box(&whitened) });
        };
        let both = self.columns[source].and(columns);
        let joint = self.linear.fit_with(self.likelihood, self.residual_m, &[&both], there)?;
        Ok(joint.iter().map(|joint| (joint.objective - there.objective).max(0.0)).sum())
    }
}
