//! The gel's law in shear: a solvent and modes of relaxation.

use crate::rheology::CreepCompliance;

/// A mode of relaxation: G (λ s)/(1 + λ s) of the complex modulus.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RelaxationMode {
    /// G in Pa.
    pub shear_modulus_pa: f64,
    /// λ in s; infinite for what does not relax.
    pub time_s: f64,
}

/// An incompressible gel in shear, G(s) = η_s s + Σ G λs/(1 + λs), with the rule that takes it to strains of any size.
#[derive(Debug, Clone, PartialEq)]
pub struct FiniteLaw {
    /// η_s in Pa·s.
    pub solvent_pa_s: f64,
    /// The polymer's modes.
    pub modes: Vec<RelaxationMode>,
    /// α in [0, ½] of Giesekus; 0 is Oldroyd-B.
    pub mobility: f64,
    /// Shortest retardation time in s.
    pub(super) fastest_s: f64,
}

impl FiniteLaw {
    /// The law with this creep compliance under a pull, incompressible: 3J in shear.
    ///
    /// The complex modulus 1/(s Ĵ) has its zeros at the retardation rates and its poles between them, one below each rate, and one beyond the last where a spring stands in series
    /// (Stieltjes; physics §2).
    pub fn new(compliance: &CreepCompliance, mobility: f64) -> Self {
        let mut rates: Vec<f64> = compliance.retarded.iter().map(|mode| 1.0 / mode.time_s).collect();
        rates.sort_by(f64::total_cmp);
        // s Ĵ and its derivative at s = −r, of shear.
        let (j0, flow) = (compliance.instantaneous_per_pa, compliance.fluidity_per_pa_s);
        let of = |r: f64| {
            let retarded: f64 =
                compliance.retarded.iter().map(|mode| mode.compliance_per_pa / (1.0 - r * mode.time_s)).sum();
            3.0 * (j0 + retarded - flow / r)
        };
        let slope = |r: f64| {
            let retarded = compliance.retarded.iter();
            let retarded: f64 = retarded.map(|m| -m.compliance_per_pa * m.time_s / (1.0 - r * m.time_s).powi(2)).sum();
            3.0 * (retarded - flow / (r * r))
        };
        let mut ends = vec![0.0];
        ends.extend(&rates);
        let mut modes = Vec::new();
        for (k, &low) in ends.iter().enumerate() {
            // Between two rates s Ĵ rises with r from −∞ to ∞; below the first it does where the gel flows.
            let high = match ends.get(k + 1) {
                Some(high) => *high,
                None if j0 > 0.0 => beyond(low.max(f64::MIN_POSITIVE), &of),
                None => break,
            };
            if low == 0.0 && flow == 0.0 {
                let at_rest: f64 = j0 + compliance.retarded.iter().map(|mode| mode.compliance_per_pa).sum::<f64>();
                modes.push(RelaxationMode { shear_modulus_pa: 1.0 / (3.0 * at_rest), time_s: f64::INFINITY });
                continue;
            }
            let rate = zero(low, high, &of);
            modes.push(RelaxationMode { shear_modulus_pa: -1.0 / (rate * slope(rate)), time_s: 1.0 / rate });
        }
        let at_once: f64 = compliance.retarded.iter().map(|m| m.compliance_per_pa / m.time_s).sum();
        let solvent_pa_s = if j0 > 0.0 { 0.0 } else { 1.0 / (3.0 * (at_once + flow)) };
        let fastest_s = compliance.retarded.iter().map(|mode| mode.time_s).fold(f64::INFINITY, f64::min);
        Self { solvent_pa_s, modes, mobility, fastest_s }
    }
}

/// A rate beyond `low` at which a rising function is positive.
fn beyond(low: f64, of: &dyn Fn(f64) -> f64) -> f64 {
    let mut high = 2.0 * low;
    while of(high) <= 0.0 && high < 1e300 {
        high *= 2.0;
    }
    high
}

/// Where a function that rises from −∞ at `low` becomes 0, before `high`.
fn zero(low: f64, high: f64, of: &dyn Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (low, high);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if of(middle) > 0.0 { high = middle } else { low = middle }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rheology::{BaseLaw, RetardedMode};

    /// 1/(3 s J(s)), J(s) by its definition.
    fn modulus(compliance: &CreepCompliance, s: f64) -> f64 {
        let retarded: f64 = compliance.retarded.iter().map(|m| m.compliance_per_pa / (1.0 + s * m.time_s)).sum();
        1.0 / (3.0 * (compliance.instantaneous_per_pa + retarded + compliance.fluidity_per_pa_s / s))
    }

    /// Solvent and modes add up to the law's modulus: three base laws, one that does not flow, one of two equal bodies.
    #[test]
    fn solvent_and_modes_add_up_to_the_law() {
        let of = |law: BaseLaw, parameters: &[f64]| law.creep_compliance(parameters).expect("exponentials");
        let body = RetardedMode { compliance_per_pa: 0.3, time_s: 0.4 };
        let laws = [
            of(BaseLaw::Lethersich, &[3.527, 1.402, 47.37]),
            of(BaseLaw::Burgers, &[3.527, 1.402, 47.37, 20.0]),
            of(BaseLaw::TwoElement, &[3.527, 1.402, 47.37, 5.0, 60.0]),
            CreepCompliance { instantaneous_per_pa: 0.1, retarded: vec![body], fluidity_per_pa_s: 0.0 },
            CreepCompliance { instantaneous_per_pa: 0.0, retarded: vec![body, body], fluidity_per_pa_s: 0.02 },
        ];
        for compliance in laws {
            let law = FiniteLaw::new(&compliance, 0.0);
            for s in [1e-4, 0.03, 1.0, 20.0, 1e4] {
                let of_mode = |mode: &RelaxationMode| {
                    if mode.time_s.is_finite() {
                        mode.shear_modulus_pa * mode.time_s * s / (1.0 + mode.time_s * s)
                    } else {
                        mode.shear_modulus_pa
                    }
                };
                let found = law.solvent_pa_s * s + law.modes.iter().map(of_mode).sum::<f64>();
                let exact = modulus(&compliance, s);
                assert!((found / exact - 1.0).abs() < 1e-9, "{law:?} at {s}: {found} {exact}");
            }
        }
    }

    /// The numbers of Table I (physics §2).
    #[test]
    fn the_papers_law_is_its_oldroyd_b() {
        let law = FiniteLaw::new(&CreepCompliance::lethersich(&[3.527, 1.402, 47.370]), 0.0);
        let [mode] = law.modes[..] else { panic!("{law:?}") };
        assert!((law.solvent_pa_s - 0.4539).abs() < 1e-4, "{law:?}");
        assert!((mode.time_s - 13.83).abs() < 0.01 && (mode.shear_modulus_pa - 1.1090).abs() < 1e-4, "{mode:?}");
    }
}
