//! Inner products over the compared rows that define the residual sum of squares, for many rates at once.

use pulp::{Arch, Simd, WithSimd};

use super::{LANES, Lanes, ResidualSumOfSquares};
use base::elementary::exp_m1_all;

/// Reference trajectory and its residuals, one entry for each row. Entries of rows that are not compared are 0.
pub(super) struct Reference {
    /// Response of a Kelvin–Voigt body of unit compliance at the reference rate, in N.
    pub response_n: Vec<f64>,
    /// Measured position minus the reference trajectory, in m.
    pub residual_m: Vec<f64>,
}

/// Sums over the compared rows for one rate. The response difference is the unit response at this rate minus the unit response at the
/// reference rate.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct InnerProducts {
    /// Sum of the residual times the response difference.
    pub residual: f64,
    /// Sum of the squared response difference.
    pub square: f64,
    /// Sum of the reference response times the response difference.
    pub reference: f64,
    /// Sum of the impulse ∫F dt times the response difference.
    pub impulse: f64,
}

impl ResidualSumOfSquares {
    /// Returns the response of a Kelvin–Voigt body of unit compliance and this rate to the force, in N, at every row.
    pub(super) fn response_n(&self, rate_per_s: f64) -> Vec<f64> {
        let mut response_n = vec![0.0; self.observed_m.len()];
        let mut state = 0.0_f64;
        for hold in &self.holds {
            // The code uses 1 − e^{−rh}, because rounding e^{−rh} would lose digits of the rate r for short steps of length h.
            let lost = -(-self.step_s[hold.step] * rate_per_s).exp_m1();
            for row in hold.rows.clone() {
                state = lost.mul_add(hold.force_n - state, state);
                response_n[row] = state;
            }
        }
        response_n
    }

    /// Returns the inner products for every rate, in the order of `rates_per_s`.
    pub(super) fn inner_products(&self, rates_per_s: &[f64], reference: &Reference) -> Vec<InnerProducts> {
        let mut found = Vec::with_capacity(rates_per_s.len());
        let mut grown = vec![[0.0; LANES]; self.step_s.len()];
        for chunk in rates_per_s.chunks(LANES) {
            for (grown, step_s) in grown.iter_mut().zip(&self.step_s) {
                for (lane, exponent) in grown.iter_mut().enumerate() {
                    *exponent = -step_s * chunk[lane.min(chunk.len() - 1)];
                }
                exp_m1_all(grown);
            }
            let mut sums = [[0.0; LANES]; 4];
            Arch::new().dispatch(ProductPass { record: self, reference, grown: &grown, sums: &mut sums });
            found.extend((0..chunk.len()).map(|lane| InnerProducts {
                residual: sums[0][lane],
                square: sums[1][lane],
                reference: sums[2][lane],
                impulse: sums[3][lane],
            }));
        }
        found
    }
}

struct ProductPass<'a> {
    record: &'a ResidualSumOfSquares,
    reference: &'a Reference,
    /// Values of e^{−rh} − 1 for each distinct step length h, with one rate r for each lane.
    grown: &'a [Lanes],
    sums: &'a mut [Lanes; 4],
}

impl WithSimd for ProductPass<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { record, reference, grown, sums } = self;
        let n_registers = S::as_simd_f64s(&sums[0][..]).0.len();
        for register in 0..n_registers {
            let mut state = simd.splat_f64s(0.0);
            let mut total = [simd.splat_f64s(0.0); 4];
            for hold in &record.holds {
                let grown = S::as_simd_f64s(&grown[hold.step][..]).0[register];
                let force = simd.splat_f64s(hold.force_n);
                for row in hold.rows.clone() {
                    state = simd.mul_add_e_f64s(grown, simd.sub_f64s(state, force), state);
                    if record.observed_m[row].is_nan() {
                        continue;
                    }
                    let response = simd.splat_f64s(reference.response_n[row]);
                    let h = simd.sub_f64s(state, response);
                    total[0] = simd.mul_add_e_f64s(simd.splat_f64s(reference.residual_m[row]), h, total[0]);
                    total[1] = simd.mul_add_e_f64s(h, h, total[1]);
                    total[2] = simd.mul_add_e_f64s(response, h, total[2]);
                    total[3] = simd.mul_add_e_f64s(simd.splat_f64s(record.impulse_n_s[row]), h, total[3]);
                }
            }
            for k in 0..4 {
                S::as_mut_simd_f64s(&mut sums[k][..]).0[register] = total[k];
            }
        }
    }
}
