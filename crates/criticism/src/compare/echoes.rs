//! Which findings show the same misfit.
//!
//! One missing effect departs from the model over time since a step, velocity, position and more at once. The look that gains most for its size comes
//! first, or the primary one where that gains at least half as much as any: it says when. Another look is an echo of such a source when the bias that the
//! source describes leaves it less than half of its gain, or less than would be significant.

use super::calibration::{Looks, Significance};
use super::linear::Linear;
use super::rows::Columns;
use base::error::Result;
use posterior::noise::NoiseLikelihood;
use posterior::whiteness::{ljung_box, runs};

/// What is left of an echo's gain beside its source, at most.
const SHARE_OF_ECHO: f64 = 0.5;
/// The primary look leads from this share of the largest gain on.
const SHARE_OF_PRIMARY: f64 = 0.5;

/// A finding, by the place of its statistic, and the one that it echoes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Standing {
    /// Place of the statistic in [`Looks::statistics`].
    pub look: usize,
    /// Place of the statistic whose echo it is.
    pub echo_of: Option<usize>,
}

/// What a record shows, and the panels' columns.
pub struct Shown<'a> {
    /// The model about its fit.
    pub linear: &'a Linear,
    /// Likelihood of the record.
    pub likelihood: &'a NoiseLikelihood,
    /// Positions less f̂, in m, one value a row.
    pub residual_m: &'a [f64],
    /// Columns of each panel.
    pub columns: &'a [Columns],
    /// Place of the primary look, the correlation of residuals with force changes.
    pub primary: Option<usize>,
    /// What was found.
    pub looks: &'a Looks,
}

/// Orders findings: sources by gain over what chance gains, then their echoes.
///
/// # Errors
/// As [`Linear::fit_base`].
pub fn standings(shown: &Shown, significant: &[usize], significance: &Significance) -> Result<Vec<Standing>> {
    let gains = &shown.looks.statistics;
    // Tests of whiteness say nothing about a place: they come after all panels.
    let is_whiteness = |look: &usize| *look >= shown.columns.len();
    let largest =
        significant.iter().filter(|look| !is_whiteness(look)).fold(0.0, |most: f64, look| most.max(gains[*look]));
    let is_leading = |look: &usize| shown.primary == Some(*look) && gains[*look] > SHARE_OF_PRIMARY * largest;
    let strength = |look: &usize| gains[*look] / significance.mean[*look].max(f64::MIN_POSITIVE);
    let class = |look: &usize| (is_whiteness(look), !is_leading(look));
    let mut order = significant.to_vec();
    order.sort_by(|a, b| class(a).cmp(&class(b)).then(strength(b).total_cmp(&strength(a))));
    let (mut sources, mut echoes): (Vec<Standing>, Vec<Standing>) = (Vec::new(), Vec::new());
    for look in order {
        let least = significance.critical[look].max(SHARE_OF_ECHO * gains[look]);
        let mut echo_of = None;
        for source in sources.iter().filter(|source| !is_whiteness(&source.look)) {
            if shown.left_beside(look, source.look)? < least {
                echo_of = Some(source.look);
                break;
            }
        }
        let list = if echo_of.is_none() { &mut sources } else { &mut echoes };
        list.push(Standing { look, echo_of });
    }
    sources.extend(echoes);
    Ok(sources)
}

impl Shown<'_> {
    /// What a look still gains where the columns of another panel are in the model.
    fn left_beside(&self, look: usize, source: usize) -> Result<f64> {
        let there = &self.looks.with[source];
        let Some(columns) = self.columns.get(look) else {
            let whitened = self.linear.whitened(self.likelihood, self.residual_m, there);
            return Ok(if look == self.columns.len() { runs(&whitened) } else { ljung_box(&whitened) });
        };
        let both = self.columns[source].and(columns);
        let joint = self.linear.fit_with(self.likelihood, self.residual_m, &[&both], there)?;
        Ok(joint.iter().map(|joint| (joint.objective - there.objective).max(0.0)).sum())
    }
}
