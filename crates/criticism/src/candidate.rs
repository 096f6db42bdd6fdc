//! A model of the mean position, and the coordinates in which a fit varies its parameters.

use base::distribution::Distribution;
use base::parameter::ParameterSpec;
use models::effects::EffectParameter;
use models::model::Model;
use posterior::problem::{Problem, TAIL_MASS};

/// Coordinate in which a fit varies a parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Coordinate {
    /// Logarithm of the parameter.
    Logarithm,
    /// The parameter divided by the interquartile range of its prior.
    Linear {
        /// Interquartile range of the prior, in the parameter's unit.
        scale: f64,
    },
    /// Square of the parameter, divided by the squared interquartile range of its prior.
    Square {
        /// Interquartile range of the prior, in the parameter's unit.
        scale: f64,
    },
}

impl Coordinate {
    /// Returns the parameter's value at the coordinate `theta`.
    pub fn value(self, theta: f64) -> f64 {
        match self {
            Self::Logarithm => theta.exp(),
            Self::Linear { scale } => scale * theta,
            Self::Square { scale } => scale * theta.max(0.0).sqrt(),
        }
    }

    /// Returns the coordinate of a parameter's value.
    pub fn theta(self, value: f64) -> f64 {
        match self {
            Self::Logarithm => value.ln(),
            Self::Linear { scale } => value / scale,
            Self::Square { scale } => (value / scale).powi(2),
        }
    }

    /// Returns the change of the parameter per unit of its coordinate. It is the derivative; for a square it is the parameter at coordinate 1.
    pub fn unit(self, theta: f64) -> f64 {
        match self {
            Self::Logarithm => theta.exp(),
            Self::Linear { scale } | Self::Square { scale } => scale,
        }
    }
}

/// A free parameter of a candidate, with its search coordinate, ends and prior.
#[derive(Debug, Clone, PartialEq)]
pub struct Free {
    /// Index in the model's list of parameters.
    pub index: usize,
    /// Name of the parameter, including its unit.
    pub name: &'static str,
    /// Coordinate in which a fit varies the parameter.
    pub coordinate: Coordinate,
    /// Lower and upper end of the search, as coordinates. They are the ends of the support, or the points where the prior leaves 10⁻⁹ on either side. The null is always
    /// inside.
    pub ends: [f64; 2],
    /// The ends of the search as values of the parameter.
    value_ends: [f64; 2],
    /// Mean and standard deviation of the coordinate under the prior, for the law's parameters and the experiment's nuisance parameters. `None` for effects: the data
    /// alone decide their size.
    pub prior: Option<(f64, f64)>,
    /// Prior whose quantiles give the starting points of a fit.
    pub distribution: Distribution,
    /// Coordinate at which the parameter's effect vanishes; `None` for the law's parameters and for parameters that are unidentified at the null.
    pub null: Option<f64>,
    /// Value of the parameter at [`Self::null`].
    null_value: Option<f64>,
    /// Index of the effect in the candidate's list; `None` for the law's parameters.
    pub effect: Option<usize>,
}

impl Free {
    /// Returns whether the null is an end of the search, so that the effect has one sign.
    pub fn is_one_sided(&self) -> bool {
        self.null.is_some_and(|null| self.ends.contains(&null))
    }

    /// Returns the parameter's value at a coordinate. It is exact at the null, and a coordinate inside the ends gives a value inside them, whatever the rounding: a
    /// springpot of an order just above 1 is no dashpot.
    pub fn value(&self, theta: f64) -> f64 {
        let value = self.coordinate.value(theta);
        match self.null_value {
            Some(null) if self.null == Some(theta) => null,
            _ if (self.ends[0]..=self.ends[1]).contains(&theta) => value.clamp(self.value_ends[0], self.value_ends[1]),
            _ => value,
        }
    }

    /// Limits the search to a range of values.
    fn limit(&mut self, value_ends: [f64; 2]) {
        self.ends = value_ends.map(|end| self.coordinate.theta(end));
        self.value_ends = value_ends;
    }

    /// Returns whether the parameter is unidentified at the null of its effect.
    pub fn is_unidentified_at_null(&self) -> bool {
        self.effect.is_some() && self.null.is_none()
    }

    /// Clamps a coordinate to the ends of the search.
    pub fn clamped(&self, theta: f64) -> f64 {
        theta.clamp(self.ends[0], self.ends[1])
    }

    /// Returns the coordinate of a prior quantile.
    pub fn quantile(&self, probability: f64) -> f64 {
        self.clamped(self.coordinate.theta(self.distribution.quantile(probability)))
    }

    /// Returns mean and standard deviation of a normal distribution that approximates the coordinate's prior.
    pub fn as_normal(&self) -> (f64, f64) {
        let [lower, median, upper] = [ONE_SD, 0.5, 1.0 - ONE_SD].map(|p| self.quantile(p));
        (median, 0.5 * (upper - lower))
    }
}

/// A model of the mean position: a law with effects, and additional columns of free amplitude.
#[derive(Clone)]
pub struct Candidate {
    /// Model of the law and its effects.
    pub model: Model,
    /// Slugs of the effects: the base's, then the added ones.
    pub effects: Vec<String>,
    /// Free parameters in the model's order: the law's, then each effect's in the library's order.
    pub free: Vec<Free>,
    /// Values of all model parameters: fixed values filled in, NaN for free parameters.
    pub template: Vec<f64>,
    /// Columns (m per unit amplitude, one value per row of the record) that are added to the position.
    pub columns: Vec<Vec<f64>>,
}

/// Probability that a normal variable lies more than one standard deviation below its mean.
const ONE_SD: f64 = 0.158_655_253_931_457;
/// Prior probability beyond either end of the interquartile range, by which coordinates are scaled.
const SPREAD_TAIL: f64 = 0.25;

impl Candidate {
    /// Returns the candidate of a problem's model, without columns.
    pub fn new(problem: &Problem) -> Self {
        let (model, fixed) = (problem.model.clone(), &problem.specification.fixed);
        let template: Vec<f64> =
            model.parameters().iter().map(|p| fixed.get(p.name).copied().unwrap_or(f64::NAN)).collect();
        let n_before = model.n_before_effects();
        // The model orders its effects as the library does. The specification may list the base's effects first.
        let listed = &problem.specification.effects;
        let place = |slug: &str| listed.iter().position(|name| name == slug).unwrap_or(listed.len());
        let of_effects: Vec<(usize, &EffectParameter)> = model
            .effects()
            .iter()
            .flat_map(|effect| effect.parameters().iter().map(|parameter| (place(effect.slug()), parameter)))
            .collect();
        let free = model.parameters().iter().enumerate().filter_map(|(index, spec)| {
            let prior = problem.priors.get(spec.name)?;
            let effect = index.checked_sub(n_before).map(|k| of_effects[k]);
            let null = effect.and_then(|(_, parameter)| (parameter.null)(model.scales()));
            let mut entry = free(index, spec, prior.distribution, effect.map(|(place, _)| place), null);
            if let (Some(range), Some(starts)) = (problem.learnt_range(spec.name), problem.starts_of(spec.name)) {
                entry.limit([range.lower, range.upper]);
                entry.distribution = starts;
            }
            Some(entry)
        });
        let free = free.collect();
        Self { effects: problem.specification.effects.clone(), free, template, columns: Vec::new(), model }
    }

    /// Returns the candidate with columns added.
    pub fn with_columns(&self, columns: Vec<Vec<f64>>) -> Self {
        Self { columns: [self.columns.clone(), columns].concat(), ..self.clone() }
    }

    /// Returns the candidate with some free parameters fixed at the coordinates `theta`: those that `is_held` accepts.
    pub fn held(&self, theta: &[f64], is_held: impl Fn(&Free) -> bool) -> Self {
        let mut held = self.clone();
        for (free, theta) in self.free.iter().zip(theta).filter(|(free, _)| is_held(free)) {
            held.template[free.index] = free.value(*theta);
        }
        held.free.retain(|free| !is_held(free));
        held
    }

    /// Returns whether trajectories must be computed one by one instead of eight at a time. This is so if an effect is nonlinear or a quantity depends on a state.
    pub fn is_slow(&self) -> bool {
        self.model.effects().iter().any(|effect| effect.is_nonlinear() || effect.depends_on_state())
    }

    /// Number of coordinates: free parameters, then amplitudes of columns.
    pub fn dimension(&self) -> usize {
        self.free.len() + self.columns.len()
    }

    /// Returns the values of all model parameters at the coordinates `theta`.
    pub fn parameters(&self, theta: &[f64]) -> Vec<f64> {
        let mut parameters = self.template.clone();
        for (free, theta) in self.free.iter().zip(theta) {
            parameters[free.index] = free.value(*theta);
        }
        parameters
    }

    /// Returns the lower and upper end of the search in one coordinate; infinite for the amplitude of a column.
    pub fn ends(&self, coordinate: usize) -> [f64; 2] {
        self.free.get(coordinate).map_or([f64::NEG_INFINITY, f64::INFINITY], |free| free.ends)
    }

    /// Returns the log prior density at coordinates, up to a constant. Only parameters with a prior contribute.
    pub fn ln_prior(&self, theta: &[f64]) -> f64 {
        let pairs = self.free.iter().zip(theta);
        pairs.filter_map(|(free, theta)| free.prior.map(|(mean, sd)| -0.5 * ((theta - mean) / sd).powi(2))).sum()
    }

    /// Returns the coordinates at which this candidate equals a smaller one with coordinates `theta`. New parameters are at their null, or at their prior's median if
    /// they have no null.
    pub fn embed(&self, smaller: &Candidate, theta: &[f64]) -> Vec<f64> {
        let known = |free: &Free| smaller.free.iter().position(|other| other.name == free.name);
        let mut embedded: Vec<f64> = self
            .free
            .iter()
            .map(|free| match known(free) {
                Some(place) => free.clamped(theta[place]),
                None => free.null.unwrap_or_else(|| free.quantile(0.5)),
            })
            .collect();
        let amplitudes = theta.get(smaller.free.len()..).unwrap_or(&[]);
        embedded.extend((0..self.columns.len()).map(|k| amplitudes.get(k).copied().unwrap_or(0.0)));
        embedded
    }
}

fn free(
    index: usize,
    spec: &ParameterSpec,
    distribution: Distribution,
    effect: Option<usize>,
    null: Option<f64>,
) -> Free {
    let quantiles = [SPREAD_TAIL, 1.0 - SPREAD_TAIL].map(|p| distribution.quantile(p));
    let is_logarithmic = match effect {
        None => spec.support.lower >= 0.0 && spec.support.upper.is_infinite(),
        Some(_) => {
            null.is_none() && matches!(distribution, Distribution::LogUniform { .. } | Distribution::LogNormal { .. })
        }
    };
    let scale = quantiles[1] - quantiles[0];
    let coordinate = match (is_logarithmic, spec.enters_as_square) {
        (true, _) => Coordinate::Logarithm,
        (false, true) => Coordinate::Square { scale },
        (false, false) => Coordinate::Linear { scale },
    };
    let mut value_ends = [TAIL_MASS, 1.0 - TAIL_MASS].map(|p| distribution.quantile(p));
    if let Some(null) = null {
        // Priors of one sign leave a small gap beside the null; the search includes it.
        value_ends = [value_ends[0].min(null), value_ends[1].max(null)];
    }
    let ends = value_ends.map(|end| coordinate.theta(end));
    let [lower, upper] = [ONE_SD, 1.0 - ONE_SD].map(|p| coordinate.theta(distribution.quantile(p)));
    let prior = effect.is_none().then(|| (coordinate.theta(distribution.quantile(0.5)), 0.5 * (upper - lower)));
    let null_value = null;
    let null = null.map(|null| coordinate.theta(null));
    Free { index, name: spec.name, coordinate, ends, value_ends, prior, distribution, null, null_value, effect }
}
