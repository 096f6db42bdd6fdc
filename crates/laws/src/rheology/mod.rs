//! Laws of springs, dashpots and springpots, and their creep compliance (physics §2). A law relates a scalar stress to a scalar
//! strain.

mod branch_cut;
mod element;
mod fractional;
mod interchangeable;
mod lumped;
mod mass;
#[cfg(test)]
mod mittag_leffler_for_tests;
mod named_networks;
mod network;
mod of_law;
mod oscillation;
mod outside;
mod relaxation;
#[cfg(test)]
mod relaxation_tests;
mod spectrum;
mod spread;
pub mod stieltjes;

pub use element::{Element, ElementPlace};
pub use interchangeable::InterchangeableParts;
pub use network::Network;
pub use oscillation::complex_modulus_pa;
pub use outside::{ExternalLaw, MOST_PARAMETERS};
pub use spectrum::{Accuracy, OscillatingMode, RetardationSpectrum, SpectralMode, TimeWindow};
pub use spread::{AdditionalTerm, SpreadTerm};

use base::distribution::Distribution;
use base::number::Dual;
use base::parameter::{
    FLOW_VISCOSITY, INSTANTANEOUS_MODULUS, ParameterSpec, RETARDATION_VISCOSITY, SECOND_MODULUS, SECOND_VISCOSITY,
    YOUNG_MODULUS,
};

/// Creep compliance of a linear law of bodies in series, J(t) = J₀ + Σ aₘ (1 − exp(−t/τₘ)) + φ t, with t the time under load.
#[derive(Debug, Clone, PartialEq)]
pub struct CreepCompliance {
    /// Instantaneous compliance J₀ in 1/Pa of the springs in series.
    pub instantaneous_per_pa: f64,
    /// Kelvin–Voigt bodies in series.
    pub retarded: Vec<RetardedMode>,
    /// Fluidity φ in 1/(Pa·s) of the dashpots in series.
    pub fluidity_per_pa_s: f64,
}

/// Kelvin–Voigt body with the creep compliance aₘ (1 − exp(−t/τₘ)).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RetardedMode {
    /// Compliance aₘ in 1/Pa.
    pub compliance_per_pa: f64,
    /// Retardation time τₘ in s.
    pub time_s: f64,
}

impl RetardedMode {
    fn kelvin_voigt(modulus_pa: f64, viscosity_pa_s: f64) -> Self {
        Self { compliance_per_pa: 1.0 / modulus_pa, time_s: viscosity_pa_s / modulus_pa }
    }
}

impl CreepCompliance {
    /// Returns the creep compliance of the Lethersich law. `parameters` are Young's modulus (Pa), retardation viscosity and flow
    /// viscosity (Pa·s).
    pub fn lethersich(parameters: &[f64]) -> Self {
        Self {
            instantaneous_per_pa: 0.0,
            retarded: vec![RetardedMode::kelvin_voigt(parameters[0], parameters[1])],
            fluidity_per_pa_s: 1.0 / parameters[2],
        }
    }

    /// Returns the creep compliance in 1/Pa at a time ≥ 0 in s; at 0 the limit from the right.
    pub fn at(&self, time_s: f64) -> f64 {
        let retarded: f64 = self.retarded.iter().map(|m| -m.compliance_per_pa * (-time_s / m.time_s).exp_m1()).sum();
        self.instantaneous_per_pa + retarded + self.fluidity_per_pa_s * time_s
    }
}

/// Constitutive law of a model without effects.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum BaseLaw {
    /// Kelvin–Voigt body in series with a dashpot: `young_modulus_pa`, `viscosity_1_pa_s`, `viscosity_2_pa_s`.
    #[default]
    Lethersich,
    /// Lethersich law with a spring in series, which adds `instantaneous_modulus_pa`.
    Burgers,
    /// Lethersich law with a second Kelvin–Voigt body in series, which adds `second_modulus_pa` and `second_viscosity_pa_s`.
    TwoElement,
    /// Network of springs, dashpots and springpots from `model.toml`. Its elements define the parameters.
    Network(&'static Network),
    /// Model of an external program, which computes trajectories.
    Outside(&'static ExternalLaw),
}

/// Name of a law that an external program computes.
pub const EXTERNAL: &str = "outside";

/// Parameters of [`BaseLaw::Lethersich`].
pub const LETHERSICH: &[ParameterSpec] = &[YOUNG_MODULUS, RETARDATION_VISCOSITY, FLOW_VISCOSITY];
const BURGERS: &[ParameterSpec] = &[YOUNG_MODULUS, RETARDATION_VISCOSITY, FLOW_VISCOSITY, INSTANTANEOUS_MODULUS];
const TWO_ELEMENT: &[ParameterSpec] =
    &[YOUNG_MODULUS, RETARDATION_VISCOSITY, FLOW_VISCOSITY, SECOND_MODULUS, SECOND_VISCOSITY];

impl BaseLaw {
    /// Named laws whose creep compliance is a closed form.
    pub const NAMED: [Self; 3] = [Self::Lethersich, Self::Burgers, Self::TwoElement];

    /// Returns the named law; `None` if there is none.
    pub fn named(name: &str) -> Option<Self> {
        let closed = Self::NAMED.into_iter().find(|law| law.name() == name);
        closed.or_else(|| Network::named(name).map(Self::Network))
    }

    /// Names of all laws that users can name.
    pub fn names() -> impl Iterator<Item = &'static str> {
        Self::NAMED.into_iter().map(Self::name).chain(Network::names())
    }

    /// Name of the law in texts for readers.
    pub fn title(self) -> &'static str {
        match self {
            Self::Lethersich => "Lethersich",
            Self::Burgers => "Burgers",
            Self::TwoElement => "two-element",
            Self::Network(network) => network.name().unwrap_or("network"),
            Self::Outside(_) => EXTERNAL,
        }
    }

    /// Name of the law in `model.toml` and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Lethersich => "lethersich",
            Self::Burgers => "burgers",
            Self::TwoElement => "two-element",
            Self::Network(network) => network.name().unwrap_or("network"),
            Self::Outside(_) => EXTERNAL,
        }
    }

    /// Parameters of the law, in the order in which [`Self::elements`] takes them.
    pub fn parameters(self) -> &'static [ParameterSpec] {
        match self {
            Self::Lethersich => LETHERSICH,
            Self::Burgers => BURGERS,
            Self::TwoElement => TWO_ELEMENT,
            Self::Network(network) => network.parameters(),
            Self::Outside(law) => law.parameters(),
        }
    }

    /// Returns the law's elements, which are in series, for the given parameter values; empty for an external law. The values are
    /// positive, in SI units and in the order of [`Self::parameters`].
    pub fn elements(self, parameters: &[Dual]) -> Vec<Element> {
        let p = parameters;
        let lethersich = || vec![Element::kelvin_voigt(p[0], p[1]), Element::Dashpot { viscosity_pa_s: p[2] }];
        let with = |element: Element| [lethersich(), vec![element]].concat();
        match self {
            Self::Lethersich => lethersich(),
            Self::Burgers => with(Element::Spring { modulus_pa: p[3] }),
            Self::TwoElement => with(Element::kelvin_voigt(p[3], p[4])),
            Self::Network(network) => network.elements(p),
            Self::Outside(_) => Vec::new(),
        }
    }

    /// Returns the place of the element whose modulus or viscosity is the parameter `name`. The element is a body in series, or
    /// an element in parallel within such a body. The result is `None` for orders of springpots, and for elements that are nested
    /// deeper or occur twice.
    pub fn leaf(self, name: &str) -> Option<ElementPlace> {
        let at = |body: usize, part: Option<usize>| Some(ElementPlace { body, part });
        match (self, name) {
            (Self::Network(network), _) => network.leaf(name),
            (Self::Outside(_), _) => None,
            (_, "young_modulus_pa") => at(0, Some(0)),
            (_, "viscosity_1_pa_s") => at(0, Some(1)),
            (_, "viscosity_2_pa_s") => at(1, None),
            (Self::Burgers, "instantaneous_modulus_pa") => at(2, None),
            (Self::TwoElement, "second_modulus_pa") => at(2, Some(0)),
            (Self::TwoElement, "second_viscosity_pa_s") => at(2, Some(1)),
            _ => None,
        }
    }

    /// Returns the creep compliance for the given parameter values, which are positive, in SI units and in the order of
    /// [`Self::parameters`].
    ///
    /// `None` for laws whose creep compliance is not a finite sum of exponentials.
    pub fn creep_compliance(self, parameters: &[f64]) -> Option<CreepCompliance> {
        let p = parameters;
        let lethersich = || CreepCompliance::lethersich(p);
        match self {
            Self::Lethersich => Some(lethersich()),
            Self::Burgers => Some(CreepCompliance { instantaneous_per_pa: 1.0 / p[3], ..lethersich() }),
            Self::TwoElement => {
                let mut law = lethersich();
                law.retarded.push(RetardedMode::kelvin_voigt(p[3], p[4]));
                Some(law)
            }
            Self::Network(_) | Self::Outside(_) => None,
        }
    }

    /// Returns the default prior of a parameter without published values, and the source of the prior's numbers. `median_of`
    /// returns the prior median of another parameter of the law by its name. The result is `None` for parameters whose priors are
    /// in prior files.
    pub fn default_prior(self, name: &str, median_of: &dyn Fn(&str) -> f64) -> Option<(Distribution, &'static str)> {
        let wide = |median: f64| Distribution::LogNormal { median, log_sd: 1.5 };
        match (self, name) {
            (Self::Burgers, "instantaneous_modulus_pa") => Some((
                wide(10.0 * median_of("young_modulus_pa")),
                "chosen: median ten times that of young_modulus_pa, standard deviation a factor of 4.5",
            )),
            (Self::TwoElement, "second_modulus_pa") => Some((
                wide(median_of("young_modulus_pa")),
                "chosen: median equal to that of young_modulus_pa, standard deviation a factor of 4.5",
            )),
            (Self::TwoElement, "second_viscosity_pa_s") => Some((
                wide(10.0 * median_of("viscosity_1_pa_s")),
                "chosen: median ten times that of viscosity_1_pa_s, standard deviation a factor of 4.5",
            )),
            (Self::Network(network), name) => network.default_prior(name),
            _ => None,
        }
    }

    /// Groups of interchangeable parts of the law. Exchanging the parameters of two parts of one group leaves the law unchanged.
    pub fn interchangeable_parts(self) -> Vec<InterchangeableParts> {
        match self {
            Self::TwoElement => {
                vec![InterchangeableParts(vec![
                    vec![YOUNG_MODULUS, RETARDATION_VISCOSITY],
                    vec![SECOND_MODULUS, SECOND_VISCOSITY],
                ])]
            }
            Self::Network(network) => network.interchangeable_parts(),
            Self::Lethersich | Self::Burgers | Self::Outside(_) => Vec::new(),
        }
    }

    /// Returns `true` if the law's creep compliance is a finite sum of exponentials ([`Self::creep_compliance`]).
    pub fn is_exponential(self) -> bool {
        match self {
            Self::Lethersich | Self::Burgers | Self::TwoElement => true,
            Self::Network(_) | Self::Outside(_) => false,
        }
    }

    /// Law of an external program; `None` for other laws.
    pub fn outside(self) -> Option<&'static ExternalLaw> {
        match self {
            Self::Outside(law) => Some(law),
            _ => None,
        }
    }
}

#[cfg(test)]
mod network_tests;
#[cfg(test)]
mod spectrum_tests;
#[cfg(test)]
mod spread_tests;
#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lethersich_limits() {
        let j = CreepCompliance::lethersich(&[3.527, 1.402, 47.370]);
        assert_eq!(j.at(0.0), 0.0);
        // At short times the law acts as two dashpots in series, at long times as a spring and a dashpot in series.
        let t = 1e-7;
        assert!((j.at(t) / (t / 1.402 + t / 47.370) - 1.0).abs() < 1e-6);
        let t = 1e3;
        assert!((j.at(t) - (1.0 / 3.527 + t / 47.370)).abs() < 1e-12);
    }

    /// Compares the closed form of every named law with the spectrum of its elements.
    #[test]
    fn named_laws_creep_as_their_elements_do() {
        let p = [3.5, 1.4, 47.0, 8.0, 30.0];
        for law in BaseLaw::NAMED {
            let p = &p[..law.parameters().len()];
            let elements = law.elements(&p.iter().map(|value| Dual::constant(*value)).collect::<Vec<_>>());
            let window = TimeWindow { shortest_s: 0.05, longest_s: 40.0 };
            let spectrum = RetardationSpectrum::of_law(&elements, window).unwrap();
            let exact = law.creep_compliance(p).unwrap();
            for t in [0.1, 1.0, 30.0] {
                assert!((spectrum.creep_compliance_per_pa(t) / exact.at(t) - 1.0).abs() < 1e-14);
            }
        }
    }

    /// Checks that `leaf` returns the place of the element of each parameter, in named laws and in a network.
    #[test]
    fn leaves_are_where_their_parameters_are() {
        let text = "parallel = [{ spring = \"gel\" }, { springpot = \"mesh\" }]";
        let network = BaseLaw::Network(Network::from_text("law.toml".as_ref(), text).unwrap());
        for law in BaseLaw::NAMED.into_iter().chain([network]) {
            let values: Vec<Dual> = (0..law.parameters().len()).map(|k| Dual::constant(0.1 + 0.1 * k as f64)).collect();
            let elements = law.elements(&values);
            let mut n_found = 0;
            for (spec, value) in law.parameters().iter().zip(&values) {
                let Some(leaf) = law.leaf(spec.name) else { continue };
                n_found += 1;
                let element = match (&elements[leaf.body], leaf.part) {
                    (Element::Parallel(parts), Some(part)) => &parts[part],
                    (entry, None) => entry,
                    other => panic!("{other:?}"),
                };
                let number = match element {
                    Element::Spring { modulus_pa } | Element::Springpot { modulus_pa, .. } => *modulus_pa,
                    Element::Dashpot { viscosity_pa_s } => *viscosity_pa_s,
                    other => panic!("{other:?}"),
                };
                assert_eq!(number, *value, "{}", spec.name);
            }
            let n_orders = law.parameters().iter().filter(|spec| spec.name.ends_with("_order")).count();
            assert_eq!(n_found, law.parameters().len() - n_orders);
        }
    }

    #[test]
    fn parameters_beyond_the_first_three_have_default_priors() {
        let median_of = |name: &str| if name == "young_modulus_pa" { 2.0 } else { 3.0 };
        for (law, name, expected) in [
            (BaseLaw::Burgers, "instantaneous_modulus_pa", 20.0),
            (BaseLaw::TwoElement, "second_modulus_pa", 2.0),
            (BaseLaw::TwoElement, "second_viscosity_pa_s", 30.0),
        ] {
            let (prior, _) = law.default_prior(name, &median_of).unwrap();
            assert_eq!(prior, Distribution::LogNormal { median: expected, log_sd: 1.5 });
        }
        for law in BaseLaw::NAMED {
            let without = law.parameters().iter().filter(|spec| law.default_prior(spec.name, &median_of).is_none());
            assert_eq!(without.count(), 3);
        }
    }
}
