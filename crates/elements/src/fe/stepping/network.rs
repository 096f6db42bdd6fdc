//! The law as a network of springs, dashpots and springpots, stepped element by element (physics
//! §3.2).
//!
//! A body is an element, or a group of elements in series or in parallel. At the three stages of a
//! Runge–Kutta step, its stresses σ and strains ε are vectors of three. A matrix and a history
//! vector relate them. A body in series is given its stress: ε = Jσ + h. A body in parallel is
//! given its strain: σ = Gε + g. A spring of modulus E has J = I/E and h = 0. A dashpot of
//! viscosity c has J = Δt A/c and h = ε at the start, with the step's length Δt and Radau's matrix
//! A. In series J and h add; in parallel G and g add. G = J⁻¹ and g = −J⁻¹h convert one form to the
//! other.
//!
//! After flattening, groups in series and in parallel alternate. One kind of group is therefore
//! enough: its parts are parallel if the stress is given, and in series if the strain is given.

use super::radau::{Radau, inverted};
use super::springpot::{ArmsStep, RateRange, Springpot};
use base::error::{Error, Result};
use base::number::Dual;
use laws::rheology::Element;
use laws::stages::ElementPlace;
use nalgebra::{Matrix3, Vector3};

/// Quantity that the network prescribes to a body (an element or a group of elements).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum PrescribedQuantity {
    /// Stress: the body is one of several in series.
    Stress,
    /// Strain: the body is one of several in parallel.
    Strain,
}

impl PrescribedQuantity {
    fn other(self) -> Self {
        match self {
            Self::Stress => Self::Strain,
            Self::Strain => Self::Stress,
        }
    }
}

/// Bodies (elements or groups of elements) in series, with their state.
#[derive(Debug, Clone)]
pub(super) struct Network {
    bodies: Vec<NetworkBody>,
    /// Index of the body that contains the element with a state-dependent stress. If the body is a
    /// group, also the index of that element in the group.
    depending: Option<(usize, Option<usize>)>,
}

/// Factors on the stress of one element of the network, one factor for each Runge–Kutta stage of a
/// time step. `part` is the element's index if the element belongs to a group.
#[derive(Debug, Clone, Copy)]
struct Factors {
    part: Option<usize>,
    at_stages: Vector3<f64>,
}

#[derive(Debug, Clone)]
struct NetworkBody {
    kind: BodyKind,
    /// Strain at zero stress (body in series) or stress at zero strain (body in parallel), at the
    /// Runge–Kutta stages of the current step.
    history: Vector3<f64>,
}

#[derive(Debug, Clone)]
enum BodyKind {
    Spring { modulus_pa: f64 },
    Dashpot { viscosity_pa_s: f64, strain: f64 },
    Springpot(Springpot),
    Group(Vec<NetworkBody>),
}

/// Coefficients of a network for steps of one length.
#[derive(Debug, Clone)]
pub(super) struct NetworkStep {
    /// Matrix that converts the stresses of the network at the Runge–Kutta stages to its strains at
    /// the stages, in 1/Pa.
    pub compliance: Matrix3<f64>,
    bodies: Vec<BodyStep>,
}

#[derive(Debug, Clone)]
struct BodyStep {
    /// Matrix that converts the prescribed quantity (stress or strain) at the Runge–Kutta stages to
    /// the other quantity.
    response: Matrix3<f64>,
    parts: Parts,
    /// Factors on the stress of the element or group, one for each Runge–Kutta stage.
    factors: Vector3<f64>,
}

#[derive(Debug, Clone)]
enum Parts {
    None,
    Arms(ArmsStep),
    Group(Vec<BodyStep>),
}

impl Network {
    /// Builds a network of elements in series, at rest.
    ///
    /// # Errors
    /// [`Error::Numerical`] for a law without resistance.
    pub fn new(law: &[Element], range: RateRange) -> Result<Self> {
        let bodies = bodies(law, PrescribedQuantity::Stress, range).ok_or_else(|| {
            Error::numerical("an element of the law has no stiffness and flows without limit", "give it a modulus")
        })?;
        Ok(Self { bodies, depending: None })
    }

    /// Builds a network in which factors multiply the stress of the element at `leaf`, one factor
    /// for each Runge–Kutta stage.
    ///
    /// # Errors
    /// Those of [`Self::new`], and [`Error::Numerical`] if the element has no strain of its own.
    pub(super) fn with_depending(law: &[Element], leaf: ElementPlace, range: RateRange) -> Result<Self> {
        let n_before = |elements: &[Element], place: usize, given: PrescribedQuantity| -> Option<usize> {
            let entry = elements.get(place..=place)?;
            let is_one = bodies(entry, given, range)?.len() == 1;
            is_one.then(|| bodies(&elements[..place], given, range).map(|before| before.len())).flatten()
        };
        let body = n_before(law, leaf.body, PrescribedQuantity::Stress);
        let part = match (leaf.part, law.get(leaf.body)) {
            (None, _) => Some(None),
            (Some(part), Some(Element::Parallel(parts))) => n_before(parts, part, PrescribedQuantity::Strain).map(Some),
            _ => None,
        };
        let depending = body.zip(part).ok_or_else(|| {
            Error::numerical("the element that depends on a state has no strain of its own", "choose another element")
        })?;
        Ok(Self { depending: Some(depending), ..Self::new(law, range)? })
    }

    /// Approximate fastest rate (1/s) at which the network responds to a change of the stress; 0 if
    /// it has no rate.
    pub(super) fn fastest_rate_per_s(&self, range: RateRange) -> f64 {
        let rate = |body: &NetworkBody| {
            let mut sizes = NetworkSizes { stiffness_pa: 0.0, viscosity_pa_s: f64::INFINITY, has_springpot: false };
            body.measure(&mut sizes);
            let springpot = if sizes.has_springpot { range.highest_per_s() } else { 0.0 };
            springpot.max(sizes.stiffness_pa / sizes.viscosity_pa_s)
        };
        self.bodies.iter().map(rate).fold(0.0, f64::max)
    }

    pub(super) fn prepare(&self, radau: &Radau, step_s: f64) -> NetworkStep {
        self.prepare_with(radau, step_s, Vector3::repeat(1.0))
    }

    /// Computes the coefficients for a time step. `at_stages` holds factors on the stress of the
    /// state-dependent element, one for each Runge–Kutta stage.
    pub(super) fn prepare_with(&self, radau: &Radau, step_s: f64, at_stages: Vector3<f64>) -> NetworkStep {
        let of = |(place, body): (usize, &NetworkBody)| {
            let pair = self.depending.filter(|(depending, _)| *depending == place);
            body.prepare(radau, step_s, PrescribedQuantity::Stress, pair.map(|(_, part)| Factors { part, at_stages }))
        };
        let bodies: Vec<BodyStep> = self.bodies.iter().enumerate().map(of).collect();
        NetworkStep { compliance: bodies.iter().map(|body| body.response).sum(), bodies }
    }

    /// Strain, at the Runge–Kutta stages, of the body that contains the state-dependent element,
    /// for given stress at the stages. Call it after [`Self::begin`]. Without such an element,
    /// returns the strain of the whole network.
    pub(super) fn strain_of_depending(&self, step: &NetworkStep, stress: &Vector3<f64>) -> Vector3<f64> {
        let all = self.bodies.iter().zip(&step.bodies).enumerate();
        let is_meant = |place: usize| self.depending.is_none_or(|(depending, _)| depending == place);
        all.filter(|(place, _)| is_meant(*place)).map(|(_, (body, step))| step.response * stress + body.history).sum()
    }

    /// Begins a time step. Returns the strains at the Runge–Kutta stages for zero stress.
    pub fn begin(&mut self, step: &NetworkStep) -> Vector3<f64> {
        self.bodies.iter_mut().zip(&step.bodies).map(|(body, step)| body.begin(step, PrescribedQuantity::Stress)).sum()
    }

    /// Ends a time step: advances every body to the step's end, for given stress at the Runge–Kutta
    /// stages.
    pub(super) fn end(&mut self, step: &NetworkStep, stress: &Vector3<f64>) {
        for (body, step) in self.bodies.iter_mut().zip(&step.bodies) {
            body.end(step, PrescribedQuantity::Stress, stress);
        }
    }
}

/// Mechanical behaviour of an element.
enum MechanicalType {
    Rigid,
    WithoutResistance,
    Body(BodyKind),
}

/// Builds bodies (elements or groups) from `elements`. `given` is the quantity that the network
/// prescribes to all of them. Elements without effect are omitted: rigid elements in series, and
/// elements without resistance in parallel. Returns `None` if one element alone determines the
/// response: an element without resistance in series, or a rigid element in parallel.
fn bodies(elements: &[Element], given: PrescribedQuantity, range: RateRange) -> Option<Vec<NetworkBody>> {
    let mut found = Vec::with_capacity(elements.len());
    for element in elements {
        let built = match element {
            Element::Spring { modulus_pa } => spring(modulus_pa.value),
            Element::Dashpot { viscosity_pa_s } => dashpot(viscosity_pa_s.value),
            Element::Compliance { compliance_per_pa } => spring(1.0 / compliance_per_pa.value),
            Element::Retarded { compliance_per_pa, time_s } => {
                let modulus_pa = Dual::constant(1.0 / compliance_per_pa.value);
                // A body of infinite modulus is rigid for any retardation time.
                let kelvin_voigt = Element::kelvin_voigt(modulus_pa, modulus_pa * time_s.value);
                found.extend(bodies(&[kelvin_voigt], given, range)?);
                continue;
            }
            Element::Springpot { modulus_pa, time_s, order } => {
                springpot(modulus_pa.value * time_s.value.powf(order.value), order.value, range)
            }
            Element::Series(inner) if given == PrescribedQuantity::Stress => {
                found.extend(bodies(inner, given, range)?);
                continue;
            }
            Element::Parallel(inner) if given == PrescribedQuantity::Strain => {
                found.extend(bodies(inner, given, range)?);
                continue;
            }
            Element::Series(inner) => match bodies(inner, PrescribedQuantity::Stress, range) {
                None => MechanicalType::WithoutResistance,
                Some(inner) if inner.is_empty() => MechanicalType::Rigid,
                Some(inner) => MechanicalType::Body(BodyKind::Group(inner)),
            },
            Element::Parallel(inner) => match bodies(inner, PrescribedQuantity::Strain, range) {
                None => MechanicalType::Rigid,
                Some(inner) if inner.is_empty() => MechanicalType::WithoutResistance,
                Some(inner) => MechanicalType::Body(BodyKind::Group(inner)),
            },
        };
        match (built, given) {
            (MechanicalType::Body(kind), _) => found.push(NetworkBody { kind, history: Vector3::zeros() }),
            (MechanicalType::Rigid, PrescribedQuantity::Stress)
            | (MechanicalType::WithoutResistance, PrescribedQuantity::Strain) => {}
            (MechanicalType::Rigid, PrescribedQuantity::Strain)
            | (MechanicalType::WithoutResistance, PrescribedQuantity::Stress) => return None,
        }
    }
    Some(found)
}

fn spring(modulus_pa: f64) -> MechanicalType {
    sized(modulus_pa, || BodyKind::Spring { modulus_pa })
}

fn dashpot(viscosity_pa_s: f64) -> MechanicalType {
    sized(viscosity_pa_s, || BodyKind::Dashpot { viscosity_pa_s, strain: 0.0 })
}

/// Builds a springpot: its stress is `coefficient` times the strain's derivative of the order
/// `order`.
fn springpot(coefficient: f64, order: f64, range: RateRange) -> MechanicalType {
    if order >= 1.0 {
        dashpot(coefficient)
    } else if order <= 0.0 {
        spring(coefficient)
    } else {
        sized(coefficient, || BodyKind::Springpot(Springpot::new(coefficient, order, range)))
    }
}

fn sized(size: f64, kind: impl FnOnce() -> BodyKind) -> MechanicalType {
    if size == 0.0 {
        MechanicalType::WithoutResistance
    } else if size == f64::INFINITY {
        MechanicalType::Rigid
    } else {
        MechanicalType::Body(kind())
    }
}

/// Stiffness and viscosity that determine the rates of an element or a group of elements.
struct NetworkSizes {
    /// Sum of the springs' moduli, in Pa.
    stiffness_pa: f64,
    /// Smallest viscosity of the dashpots, in Pa·s.
    viscosity_pa_s: f64,
    has_springpot: bool,
}

impl NetworkBody {
    fn measure(&self, sizes: &mut NetworkSizes) {
        match &self.kind {
            BodyKind::Spring { modulus_pa } => sizes.stiffness_pa += modulus_pa,
            BodyKind::Dashpot { viscosity_pa_s, .. } => {
                sizes.viscosity_pa_s = sizes.viscosity_pa_s.min(*viscosity_pa_s)
            }
            BodyKind::Springpot(_) => sizes.has_springpot = true,
            BodyKind::Group(bodies) => bodies.iter().for_each(|body| body.measure(sizes)),
        }
    }

    fn prepare(&self, radau: &Radau, step_s: f64, given: PrescribedQuantity, factors: Option<Factors>) -> BodyStep {
        let factors_of = |part: Option<usize>| {
            factors.filter(|factors| factors.part == part).map_or(Vector3::repeat(1.0), |factors| factors.at_stages)
        };
        let factors_here = factors_of(None);
        let [by_factor, over_factor] =
            [factors_here, factors_here.map(f64::recip)].map(|diagonal| Matrix3::from_diagonal(&diagonal));
        let alone = |response| BodyStep { response, parts: Parts::None, factors: factors_here };
        match (&self.kind, given) {
            (BodyKind::Spring { modulus_pa }, PrescribedQuantity::Stress) => alone(over_factor / *modulus_pa),
            (BodyKind::Spring { modulus_pa }, PrescribedQuantity::Strain) => alone(by_factor * *modulus_pa),
            (BodyKind::Dashpot { viscosity_pa_s, .. }, PrescribedQuantity::Stress) => {
                alone(radau.matrix * over_factor * (step_s / viscosity_pa_s))
            }
            (BodyKind::Dashpot { viscosity_pa_s, .. }, PrescribedQuantity::Strain) => {
                alone(by_factor * radau.inverse * (viscosity_pa_s / step_s))
            }
            (BodyKind::Springpot(springpot), _) => {
                let arms = springpot.prepare(radau, step_s);
                let stiffness = by_factor * arms.stiffness;
                let response = if given == PrescribedQuantity::Stress { inverted(stiffness) } else { stiffness };
                BodyStep { response, parts: Parts::Arms(arms), factors: factors_here }
            }
            (BodyKind::Group(bodies), _) => {
                let of = |(place, body): (usize, &NetworkBody)| {
                    let entry = factors
                        .filter(|factors| factors.part == Some(place))
                        .map(|factors| Factors { part: None, ..factors });
                    body.prepare(radau, step_s, given.other(), entry)
                };
                let steps: Vec<BodyStep> = bodies.iter().enumerate().map(of).collect();
                let response = inverted(steps.iter().map(|step| step.response).sum());
                BodyStep { response, parts: Parts::Group(steps), factors: factors_here }
            }
        }
    }

    fn begin(&mut self, step: &BodyStep, given: PrescribedQuantity) -> Vector3<f64> {
        self.history = match (&mut self.kind, &step.parts) {
            (BodyKind::Dashpot { strain, .. }, _) => match given {
                PrescribedQuantity::Stress => Vector3::repeat(*strain),
                PrescribedQuantity::Strain => step.response * Vector3::repeat(-*strain),
            },
            (BodyKind::Springpot(springpot), Parts::Arms(arms)) => {
                let stress = springpot.history_pa(arms).component_mul(&step.factors);
                if given == PrescribedQuantity::Stress { -(step.response * stress) } else { stress }
            }
            (BodyKind::Group(bodies), Parts::Group(steps)) => {
                let parts = bodies.iter_mut().zip(steps).map(|(body, step)| body.begin(step, given.other()));
                -(step.response * parts.sum::<Vector3<f64>>())
            }
            _ => Vector3::zeros(),
        };
        self.history
    }

    fn end(&mut self, step: &BodyStep, given: PrescribedQuantity, received: &Vector3<f64>) {
        let answer = step.response * received + self.history;
        let strain_of_it = if given == PrescribedQuantity::Stress { &answer } else { received };
        match (&mut self.kind, &step.parts) {
            (BodyKind::Dashpot { strain, .. }, _) => *strain = strain_of_it[2],
            (BodyKind::Springpot(springpot), Parts::Arms(arms)) => springpot.advance(arms, strain_of_it),
            (BodyKind::Group(bodies), Parts::Group(steps)) => {
                for (body, step) in bodies.iter_mut().zip(steps) {
                    body.end(step, given.other(), &answer);
                }
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A Kelvin body responds at its E/η, and a dashpot alone has no rate.
    #[test]
    fn the_fastest_rate_is_that_of_the_stiffest_body() {
        let range = RateRange::between(1e-3, 10.0);
        let rate = |law: &[Element]| Network::new(law, range).unwrap().fastest_rate_per_s(range);
        let spring = |modulus_pa: f64| Element::Spring { modulus_pa: modulus_pa.into() };
        let dashpot = |viscosity_pa_s: f64| Element::Dashpot { viscosity_pa_s: viscosity_pa_s.into() };
        let kelvin =
            |modulus_pa: f64, viscosity_pa_s: f64| Element::Parallel(vec![spring(modulus_pa), dashpot(viscosity_pa_s)]);
        assert_eq!(rate(&[kelvin(100.0, 50.0), kelvin(30.0, 5.0), dashpot(0.01)]), 6.0);
        assert_eq!(rate(&[spring(7.0), dashpot(0.01)]), 0.0);
        let springpot = Element::Springpot { modulus_pa: 1.0.into(), time_s: 1.0.into(), order: 0.5.into() };
        assert_eq!(rate(&[kelvin(100.0, 50.0), springpot]), range.highest_per_s());
    }
}
