//! Terms of a pair of matrices that depends on a shape parameter. θ is the fraction of an eigenvector's stiffness that comes from
//! the second matrix. At any value of the parameter, θ has exactly three values (physics §7.2): 0, one between 0 and 1, and 1.
//!
//! The error of finite elements splits the middle θ into several nearby values, which are replaced by their mean.

use std::f64::consts::PI;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::spread::FieldModes;
use crate::effects::{FieldSystem, MatrixPair, ShapeParameter};
use base::error::{Error, Result};
use base::number::{Dual, Scalar};
use elements::fe::spatial::GelAndRobot;
use laws::rheology::SpreadTerm;

/// Number of values of the shape parameter at which the terms are computed.
pub(super) const N_SHAPES: usize = 8;
/// Distance from 0 or 1 below which the fraction θ of the second matrix's stiffness counts as 0 or 1.
const NEAR: f64 = 0.05;

/// Three terms of a pair of matrices, as functions of the shape parameter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ThreeTerms {
    /// Name of the shape parameter.
    parameter: String,
    /// Trained range of the shape parameter.
    range: [f64; 2],
    /// Logarithms of the three weights and the logit of the middle stiffness fraction θ, at Chebyshev points of the parameter's logarithm.
    at_shapes: Vec<[f64; 4]>,
}

impl ThreeTerms {
    /// Reduces the full-order model at each Chebyshev point of the shape parameter.
    ///
    /// # Errors
    /// Errors of the full-order model. [`Error::Numerical`] if one of the three terms is missing.
    pub fn new(
        pair: &dyn MatrixPair,
        ShapeParameter { name, range }: ShapeParameter,
        surroundings: &GelAndRobot<'_>,
        tolerance: f64,
        shape_done: &(dyn Fn() + Sync),
    ) -> Result<Self> {
        let splitting = pair.splitting(&surroundings.sizes);
        let [lower, upper] = range.map(f64::ln);
        let at = |i: usize| {
            let x = -(PI * (i as f64 + 0.5) / N_SHAPES as f64).cos();
            let shape = (0.5 * (lower + upper) + 0.5 * (upper - lower) * x).exp();
            let FieldSystem { system, .. } = pair.system(surroundings, Some(shape))?;
            let modes = FieldModes::new(&system, &splitting, tolerance)?;
            shape_done();
            Ok(modes)
        };
        let modes: Vec<FieldModes> = (0..N_SHAPES).into_par_iter().map(at).collect::<Result<_>>()?;
        let at_shapes: Vec<[f64; 4]> = modes.iter().map(three_terms).collect();
        if at_shapes.iter().flatten().any(|x| !x.is_finite()) {
            return Err(Error::numerical(
                format!("the reduced model with {} lacks one of its three terms", pair.words()),
                "use a finer mesh around the robot",
            ));
        }
        Ok(Self { parameter: name.into(), range, at_shapes })
    }

    /// Returns the three terms at a value of the shape parameter.
    ///
    /// # Errors
    /// [`Error::OutsideTrainedRange`] if the value is outside the trained range.
    pub fn terms(&self, shape: Dual) -> Result<Vec<SpreadTerm>> {
        let [lower, upper] = self.range;
        if !(lower..=upper).contains(&shape.value) {
            let parameter = self.parameter.clone();
            return Err(Error::OutsideTrainedRange { parameter, value: shape.value, lower, upper });
        }
        let (a, b) = (lower.ln(), upper.ln());
        let x = (shape.ln() * 2.0 - Dual::constant(a + b)) * (b - a).recip();
        let shares = lagrange(x);
        let value = |k: usize| {
            self.at_shapes.iter().zip(&shares).fold(Dual::ZERO, |sum, (at_shape, share)| sum + *share * at_shape[k])
        };
        let weights = [0, 1, 2].map(|k| value(k).exp());
        let whole = weights.iter().fold(Dual::ZERO, |sum, weight| sum + *weight);
        let grown = value(3).exp();
        let numbers = [Dual::ZERO, grown / (Dual::ONE + grown), Dual::ONE];
        Ok(weights.iter().zip(numbers).map(|(weight, number)| SpreadTerm { weight: *weight / whole, number }).collect())
    }
}

/// Returns the logarithms of the weights for θ = 0, for the middle θ and for θ = 1, and the logit of the mean middle θ. θ is the fraction
/// of a term's stiffness that comes from the second matrix.
fn three_terms(modes: &FieldModes) -> [f64; 4] {
    let (mut weights, mut moment) = ([0.0; 3], 0.0);
    for (weight, share) in modes.weights.iter().zip(&modes.numbers) {
        match *share {
            share if share < NEAR => weights[0] += weight,
            share if share > 1.0 - NEAR => weights[2] += weight,
            share => {
                weights[1] += weight;
                moment += weight * share;
            }
        }
    }
    let between = moment / weights[1];
    [weights[0].ln(), weights[1].ln(), weights[2].ln(), (between / (1.0 - between)).ln()]
}

/// Returns the values at x of Lagrange's polynomials through the Chebyshev points on [−1, 1].
fn lagrange(x: Dual) -> [Dual; N_SHAPES] {
    let point = |i: usize| -(PI * (i as f64 + 0.5) / N_SHAPES as f64).cos();
    std::array::from_fn(|i| {
        (0..N_SHAPES)
            .filter(|j| *j != i)
            .fold(Dual::ONE, |product, j| product * (x - Dual::constant(point(j))) * (point(i) - point(j)).recip())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::{EFFECTS, FieldEffect};
    use elements::fe::Stiffness;
    use elements::fe::spatial::PhysicalProperties;
    use elements::mesh::QuarterBall;

    /// Compares interpolated terms with terms from separate meshes, at intermediate radii and at the ends of the range.
    #[test]
    #[ignore = "thorough"]
    fn three_terms_serve_pockets_of_any_radius() {
        let (robot_radius_m, outer_radius_m) = (0.275e-3, 10e-3);
        let ball = QuarterBall { robot_radius_m, outer_radius_m, n_per_edge: 2, n_layers: 8 };
        let mesh = ball.mesh().unwrap();
        let stiffness = Stiffness::new(&mesh).unwrap();
        let surroundings = GelAndRobot {
            mesh: &mesh,
            stiffness: &stiffness,
            poisson_ratio: 0.48,
            sizes: PhysicalProperties {
                gel_density_kg_m3: 1000.0,
                robot_mass_kg: 1e-6,
                robot_radius_m,
                outer_radius_m,
                ball: Some(ball),
            },
        };
        let with_shape = |field: FieldEffect| matches!(field, FieldEffect::Pair(pair) if pair.shape().is_some());
        let field = EFFECTS.iter().filter_map(|effect| effect.field()).find(|field| with_shape(*field));
        let Some(FieldEffect::Pair(pair)) = field else { panic!("no effect has a shape") };
        let shape = pair.shape().unwrap();
        let pocket = ThreeTerms::new(pair, shape, &surroundings, 1e-6, &|| ()).unwrap();
        for ratio in [1.5, 1.7, 3.0, 5.0] {
            let FieldSystem { system, .. } = pair.system(&surroundings, Some(ratio)).unwrap();
            let modes = FieldModes::new(&system, &pair.splitting(&surroundings.sizes), 1e-6).unwrap();
            let terms = pocket.terms(ratio.into()).unwrap();
            for x in [-0.3, -0.9, -0.999] {
                let found: f64 = terms.iter().map(|t| t.weight.value / (1.0 + x * t.number.value)).sum();
                let error = found / modes.relative_compliance(x) - 1.0;
                println!("{ratio} radii, softer by {}: {error:e}", 1.0 + x);
                assert!(error.abs() < 1e-4, "{ratio} radii, softer by {}: {error:e}", 1.0 + x);
            }
        }
        assert!(matches!(pocket.terms(5.1.into()), Err(Error::OutsideTrainedRange { value: 5.1, upper: 5.0, .. })));
    }
}
