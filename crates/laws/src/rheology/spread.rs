//! Creep of a gel whose displacement field changes shape under load. The complex compliance 1/G of the law is replaced by a sum Σ
//! w/(G + x) of a few terms, with G the law's modulus, w a weight and x the modulus of an additional element.
//!
//! The equations of such a field have the matrix A a(s) + B b(s). A and B are symmetric matrices, a and b scalar functions of the
//! Laplace variable s. The common eigenvectors of A and B split the robot's complex compliance into terms with weights w ≥ 0.
//! Each term has a factor μ ≥ 0 or a fraction θ in [0, 1] of the additional element:
//!
//! - [`AdditionalTerm::Friction`]: w/(G + μ s/b), with b the compliance of an interface or the mobility of a pore fluid;
//! - [`AdditionalTerm::Mass`]: w/(G + μ d s²), with d the scale of the mass;
//! - [`AdditionalTerm::Law`]: w/(θ G₁ + (1 − θ) G), with G₁ the modulus of another law;
//! - [`AdditionalTerm::Spring`]: w/(θ/b + (1 − θ) G), with b the compliance of a spring.
//!
//! Every term is the law in parallel with a dashpot, a mass, a spring or another law, and its creep is a sum of exponentials. The
//! Lethersich law has closed forms. Other laws use the algorithm of [`super::stieltjes`]. With a mass, the rates are the zeros of
//! G/s + μ d s.

use super::spectrum::{Accuracy, TimeWindow};
use super::{Element, OscillatingMode, RetardationSpectrum, SpectralMode, stieltjes};
use base::error::{Error, Result};
use base::number::{Dual, PointScalar};

/// Additional element in parallel with the law. Its size differs from term to term by the term's factor μ or fraction θ.
#[derive(Debug, Clone, PartialEq)]
pub enum AdditionalTerm {
    /// Dashpot of viscosity μ/b, with μ the term's factor.
    Friction {
        /// Compliance or mobility b ≥ 0. At b = 0 terms with μ > 0 do not move.
        compliance: Dual,
    },
    /// Mass μ d, with μ the term's factor.
    Mass {
        /// Scale d ≥ 0 of the mass.
        scale: Dual,
    },
    /// Second law, multiplied by the term's fraction θ. The first law is multiplied by 1 − θ.
    Law(Vec<Element>),
    /// Spring of modulus θ/b, with θ the term's fraction. The law is multiplied by 1 − θ.
    Spring {
        /// Compliance b ≥ 0 in 1/Pa. At b = 0 terms with θ > 0 do not move.
        compliance_per_pa: Dual,
    },
}

/// Term w/(G + x) of the complex compliance, with a weight w, the law's modulus G and the modulus x of the additional element.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpreadTerm {
    /// Weight w of the term, relative to the compliance of the base model.
    pub weight: Dual,
    /// Factor μ or fraction θ by which the additional element is multiplied.
    pub number: Dual,
}

/// Returns Young's modulus, retardation viscosity and flow viscosity of a Lethersich law; `None` for other laws.
fn lethersich<T: PointScalar>(law: &[Element]) -> Option<[T; 3]> {
    let [Element::Parallel(body), Element::Dashpot { viscosity_pa_s: flow }] = law else { return None };
    let [Element::Spring { modulus_pa }, Element::Dashpot { viscosity_pa_s }] = body.as_slice() else { return None };
    Some([*modulus_pa, *viscosity_pa_s, *flow].map(T::from_dual))
}

impl<T: PointScalar> RetardationSpectrum<T> {
    /// Returns the retardation spectrum of a sum of terms. In each term the law is in parallel with the additional element
    /// `beside`, multiplied by the term's factor.
    ///
    /// # Errors
    /// Errors of [`Self::of_law_with_accuracy`]. [`Error::Numerical`] for a mass in parallel with a law with springpots.
    pub fn spread(
        law: &[Element],
        beside: &AdditionalTerm,
        terms: &[SpreadTerm],
        window: TimeWindow,
        accuracy: Accuracy,
    ) -> Result<Self> {
        let mut spectrum = Self::empty();
        for term in terms {
            match beside {
                AdditionalTerm::Friction { compliance } => {
                    spectrum.add_with_friction(law, *compliance, *term, window, accuracy)?;
                }
                AdditionalTerm::Mass { scale } => spectrum.add_with_mass(law, *scale, *term)?,
                AdditionalTerm::Spring { compliance_per_pa } => {
                    spectrum.add_with_spring(law, *compliance_per_pa, *term, window, accuracy)?;
                }
                AdditionalTerm::Law(second) => spectrum.add_shared(law, second, *term, window, accuracy)?,
            }
        }
        Ok(spectrum)
    }

    fn add_with_friction(
        &mut self,
        law: &[Element],
        compliance: Dual,
        term: SpreadTerm,
        window: TimeWindow,
        accuracy: Accuracy,
    ) -> Result<()> {
        if term.number.is_constant(0.0) {
            return self.add_scaled(&Self::of_law_with_accuracy(law, window, accuracy)?, T::from_dual(term.weight));
        }
        if compliance.is_constant(0.0) {
            return Ok(());
        }
        if let Some([e, c1, c2]) = lethersich::<T>(law) {
            let (weight, mu, b) = (T::from_dual(term.weight), T::from_dual(term.number), T::from_dual(compliance));
            let (viscous, flowing) = (b * c1 * c2 + mu * (c1 + c2), b * c2 + mu);
            let rate_per_s = e * flowing / viscous;
            let drop = weight * e * c2 * c2 * b * b / (viscous * viscous);
            self.fluidity_per_pa_s += weight * b / flowing;
            self.modes.push(SpectralMode { compliance_per_pa: drop / (rate_per_s * rate_per_s), rate_per_s });
            return Ok(());
        }
        if compliance.value == 0.0 {
            // To first order in the dashpot's compliance b, the term is w b/(μ s) for every law, with s the Laplace variable.
            self.fluidity_per_pa_s += T::from_dual(term.weight * compliance / term.number);
            return Ok(());
        }
        let dashpot = Element::Dashpot { viscosity_pa_s: term.number / compliance };
        self.add_parallel_terms(vec![Element::Series(law.to_vec()), dashpot], term.weight, window, accuracy)
    }

    /// Adds the term w/(θ/b + (1 − θ) G) of a law with modulus G and a spring of compliance b in parallel. w is the term's weight
    /// and θ its fraction.
    fn add_with_spring(
        &mut self,
        law: &[Element],
        compliance: Dual,
        term: SpreadTerm,
        window: TimeWindow,
        accuracy: Accuracy,
    ) -> Result<()> {
        let (share, rest) = (term.number, Dual::ONE - term.number);
        if share.is_constant(0.0) {
            return self.add_scaled(&Self::of_law_with_accuracy(law, window, accuracy)?, T::from_dual(term.weight));
        }
        if compliance.is_constant(0.0) {
            return Ok(());
        }
        if compliance.value == 0.0 || rest.is_constant(0.0) {
            // To first order in the spring's compliance b, the term is w b/θ for every law.
            self.instantaneous_per_pa += T::from_dual(term.weight * compliance / share);
            return Ok(());
        }
        if let Some([e, c1, c2]) = lethersich::<T>(law) {
            let [theta, b] = [share, compliance].map(T::from_dual);
            self.add_lethersich_with_spring(T::from_dual(term.weight), theta, b, [e, c1, c2]);
            return Ok(());
        }
        let scaled = |element: &Element| element.scaled(rest);
        let beside = Element::Spring { modulus_pa: share / compliance };
        let elements = vec![Element::Series(law.iter().map(scaled).collect()), beside];
        self.add_parallel_terms(elements, term.weight, window, accuracy)
    }

    /// Adds the term w b (E + Cs)/N of a Lethersich law (E, c₁, c₂) and a spring of compliance b in parallel. w is the term's
    /// weight, θ its fraction and s the Laplace variable. Here C = c₁ + c₂ and N = (1 − θ) b c₁c₂ s² + (θC + (1 − θ) b c₂E) s +
    /// θE.
    fn add_lethersich_with_spring(&mut self, weight: T, theta: T, b: T, [e, c1, c2]: [T; 3]) {
        let (c, rest) = (c1 + c2, (T::constant(1.0) - theta) * b);
        let (quadratic, linear, constant) = (rest * c1 * c2, theta * c + rest * c2 * e, theta * e);
        let root = (linear * linear - quadratic * constant * 4.0).sqrt();
        let larger = (linear + root) * 0.5;
        let (fast, slow) = (larger / quadratic, constant / larger);
        for (rate, other) in [(fast, slow), (slow, fast)] {
            // The gain is the residue of the term at s = −rate, divided by the rate.
            let gain = b * (e - c * rate) / (quadratic * rate * (other - rate));
            self.modes.push(SpectralMode { compliance_per_pa: weight * gain, rate_per_s: rate });
        }
    }

    fn add_shared(
        &mut self,
        law: &[Element],
        second: &[Element],
        term: SpreadTerm,
        window: TimeWindow,
        accuracy: Accuracy,
    ) -> Result<()> {
        let (share, rest) = (term.number, Dual::ONE - term.number);
        if let (Some([e, c1, c2]), Some([soft, ..])) = (lethersich::<T>(law), lethersich::<T>(second)) {
            let (weight, theta) = (T::from_dual(term.weight), T::from_dual(share));
            self.add_two_lethersich(weight, theta, [e, soft], [c1, c2]);
            return Ok(());
        }
        // A law that is multiplied by 0 is omitted.
        for (number, alone) in [(rest, second), (share, law)] {
            if number.is_constant(0.0) {
                return self
                    .add_scaled(&Self::of_law_with_accuracy(alone, window, accuracy)?, T::from_dual(term.weight));
            }
        }
        let scaled = |elements: &[Element], factor: Dual| {
            Element::Series(elements.iter().map(|element| element.scaled(factor)).collect())
        };
        self.add_parallel_terms(vec![scaled(second, share), scaled(law, rest)], term.weight, window, accuracy)
    }

    /// Adds the term w/(θ G₁ + (1 − θ) G) of two Lethersich laws with moduli G₁ and G. Their springs are E₁ and E, their dashpots
    /// c₁ and c₂ are equal. The term is w (E₁ + Cs)(E + Cs)/(c₂ s N), with s the Laplace variable, C = c₁ + c₂ and N = c₁C s² +
    /// (θ(E₁C + c₁E) + (1 − θ)(EC + c₁E₁)) s + E₁E.
    fn add_two_lethersich(&mut self, weight: T, theta: T, [e, soft]: [T; 2], [c1, c2]: [T; 2]) {
        let c = c1 + c2;
        let quadratic = c1 * c;
        let linear = theta * (soft * c + c1 * e) + (T::constant(1.0) - theta) * (e * c + c1 * soft);
        let constant = e * soft;
        let root = (linear * linear - quadratic * constant * 4.0).sqrt();
        let larger = (linear + root) * 0.5;
        let (fast, slow) = (larger / quadratic, constant / larger);
        self.fluidity_per_pa_s += weight / c2;
        for (rate, other) in [(fast, slow), (slow, fast)] {
            // The gain is the residue of the term at s = −rate. The mode's compliance is the gain divided by the rate.
            let gain = (soft - c * rate) * (e - c * rate) / (c2 * quadratic * rate * (rate - other));
            self.modes.push(SpectralMode { compliance_per_pa: weight * gain / rate, rate_per_s: rate });
        }
    }

    fn add_with_mass(&mut self, law: &[Element], scale: Dual, term: SpreadTerm) -> Result<()> {
        let mass = term.number * scale;
        if let Some([e, c1, c2]) = lethersich::<T>(law) {
            self.add_lethersich_with_mass(T::from_dual(term.weight), T::from_dual(mass), [e, c1, c2]);
            return Ok(());
        }
        let with_mass = stieltjes::with_mass(&Element::Series(law.to_vec()), mass).ok_or_else(|| {
            Error::numerical(
                "the creep of this law in parallel with a mass cannot be computed",
                "use a law without springpots, and a finite difference for the derivative at a density of 0",
            )
        })?;
        self.add_scaled(&with_mass.converted(), T::from_dual(term.weight))
    }

    /// Adds the term w (E + Cs)/(s N) of a Lethersich law (E, c₁, c₂) and a mass m in parallel, with the weight w and the Laplace
    /// variable s. Here C = c₁ + c₂ and N = m C s² + (c₁c₂ + m E) s + c₂E.
    fn add_lethersich_with_mass(&mut self, weight: T, mass: T, [e, c1, c2]: [T; 3]) {
        let c = c1 + c2;
        let (quadratic, linear, constant) = (mass * c, c1 * c2 + mass * e, c2 * e);
        let square = linear * linear - quadratic * constant * 4.0;
        self.fluidity_per_pa_s += weight / c2;
        if square.value() > 0.0 {
            let larger = (linear + square.sqrt()) * 0.5;
            let slow = constant / larger;
            let apart = larger - quadratic * slow;
            let gain = (c * slow - e) / (slow * apart);
            self.modes.push(SpectralMode { compliance_per_pa: weight * gain / slow, rate_per_s: slow });
            // This mode has the rate larger/quadratic, which is infinite without a mass.
            let at_once = (e * quadratic - c * larger) * quadratic / (larger * larger * apart) * weight;
            if mass.value() > 0.0 {
                self.modes.push(SpectralMode { compliance_per_pa: at_once, rate_per_s: larger / quadratic });
            } else {
                self.instantaneous_per_pa += at_once;
            }
            return;
        }
        let half = T::constant(0.5) / quadratic;
        let (re, im) = (linear * half, (-square).sqrt() * half);
        // The two rates are Λ = re + i im and its conjugate. The mode of Λ has the compliance (CΛ − E)/(Λ² quadratic (−2 i im)),
        // which is doubled to include the conjugate.
        let top = [c * re - e, c * im];
        let bottom = multiplied(multiplied([re, im], [re, im]), [T::constant(0.0), quadratic * im * -2.0]);
        let size = bottom[0] * bottom[0] + bottom[1] * bottom[1];
        let both = weight * 2.0 / size;
        let compliance = multiplied(top, [bottom[0], -bottom[1]]).map(|part| part * both);
        self.oscillating.push(OscillatingMode { compliance_per_pa: compliance, rate_per_s: [re, im] });
    }

    fn add_parallel_terms(
        &mut self,
        elements: Vec<Element>,
        weight: Dual,
        window: TimeWindow,
        accuracy: Accuracy,
    ) -> Result<()> {
        let spectrum = Self::of_law_with_accuracy(&[Element::Parallel(elements)], window, accuracy)?;
        self.add_scaled(&spectrum, T::from_dual(weight))
    }

    /// Adds another spectrum, multiplied by `weight`.
    pub(super) fn add_scaled(&mut self, other: &Self, weight: T) -> Result<()> {
        self.instantaneous_per_pa += other.instantaneous_per_pa * weight;
        self.fluidity_per_pa_s += other.fluidity_per_pa_s * weight;
        self.modes.extend(other.modes.iter().map(|mode| SpectralMode {
            compliance_per_pa: mode.compliance_per_pa * weight,
            rate_per_s: mode.rate_per_s,
        }));
        self.oscillating.extend(other.oscillating.iter().map(|mode| OscillatingMode {
            compliance_per_pa: mode.compliance_per_pa.map(|part| part * weight),
            rate_per_s: mode.rate_per_s,
        }));
        Ok(())
    }
}

impl RetardationSpectrum<Dual> {
    /// Converts the spectrum to another number type.
    fn converted<T: PointScalar>(&self) -> RetardationSpectrum<T> {
        let mut spectrum = RetardationSpectrum::empty();
        spectrum.extend(self);
        spectrum
    }
}

fn multiplied<T: PointScalar>([a, b]: [T; 2], [c, d]: [T; 2]) -> [T; 2] {
    [a * c - b * d, a * d + b * c]
}
