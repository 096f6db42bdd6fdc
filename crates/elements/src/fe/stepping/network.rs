//! The law as a network of elements, stepped element by element (physics §3.2).
//!
//! At the three stages of a step every body relates stresses σ and strains ε (vectors of three) by its matrix and its history: ε = Jσ + h
//! where the stress is given (in series), σ = Gε + g where the strain is (in parallel). Springs: J = I/E, h = 0. Dashpots, c ε̇ = σ:
//! J = Δt A/c, h = ε at the start. In series J and h add, in parallel G and g; G = J⁻¹, g = −J⁻¹h lead from one to the other.
//! Bodies in series and in parallel alternate after flattening, so one kind of group serves: parallel where its stress is given, in series
//! where its strain is.

use super::radau::{Radau, inverted};
use super::springpot::{ArmsStep, RateRange, Springpot};
use base::error::{Error, Result};
use base::number::Dual;
use laws::rheology::Element;
use laws::stages::Leaf;
use nalgebra::{Matrix3, Vector3};

/// What a body is given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Given {
    /// The stress: the body is one of several in series.
    Stress,
    /// The strain: the body is one of several in parallel.
    Strain,
}

impl Given {
    fn other(self) -> Self {
        match self {
            Self::Stress => Self::Strain,
            Self::Strain => Self::Stress,
        }
    }
}

/// Bodies in series with their state.
#[derive(Debug, Clone)]
pub(super) struct Network {
    bodies: Vec<Body>,
    /// Place of the body whose element depends on a state, and of the part of it that does.
    depending: Option<(usize, Option<usize>)>,
}

/// Factors of an element's stress at the stages: of a body, or of one of its parts.
#[derive(Debug, Clone, Copy)]
struct Factors {
    part: Option<usize>,
    at_stages: Vector3<f64>,
}

#[derive(Debug, Clone)]
struct Body {
    kind: Kind,
    /// h or g of the step under way.
    history: Vector3<f64>,
}

#[derive(Debug, Clone)]
enum Kind {
    Spring { modulus_pa: f64 },
    Dashpot { viscosity_pa_s: f64, strain: f64 },
    Springpot(Springpot),
    Group(Vec<Body>),
}

/// What a step of one length needs of the network.
#[derive(Debug, Clone)]
pub(super) struct NetworkStep {
    /// J of the whole.
    pub compliance: Matrix3<f64>,
    bodies: Vec<BodyStep>,
}

#[derive(Debug, Clone)]
struct BodyStep {
    /// J or G, whichever the body is asked for.
    response: Matrix3<f64>,
    parts: Parts,
    /// Of its stress at the stages.
    factors: Vector3<f64>,
}

#[derive(Debug, Clone)]
enum Parts {
    None,
    Arms(ArmsStep),
    Group(Vec<BodyStep>),
}

impl Network {
    /// The network of elements in series, at rest.
    ///
    /// # Errors
    /// [`Error::Numerical`] for a law without resistance.
    pub fn new(law: &[Element], range: RateRange) -> Result<Self> {
        let bodies = bodies(law, Given::Stress, range).ok_or_else(|| {
            Error::numerical("an element of the law has no stiffness, so it flows without end", "give it a modulus")
        })?;
        Ok(Self { bodies, depending: None })
    }

    /// The same with an element whose stress is multiplied by factors at the stages.
    ///
    /// # Errors
    /// As [`Self::new`], and where the element is none with a strain of its own.
    pub(super) fn with_depending(law: &[Element], leaf: Leaf, range: RateRange) -> Result<Self> {
        let n_before = |elements: &[Element], place: usize, given: Given| -> Option<usize> {
            let own = elements.get(place..=place)?;
            let is_one = bodies(own, given, range)?.len() == 1;
            is_one.then(|| bodies(&elements[..place], given, range).map(|before| before.len())).flatten()
        };
        let body = n_before(law, leaf.body, Given::Stress);
        let part = match (leaf.part, law.get(leaf.body)) {
            (None, _) => Some(None),
            (Some(part), Some(Element::Parallel(parts))) => n_before(parts, part, Given::Strain).map(Some),
            _ => None,
        };
        let depending = body.zip(part).ok_or_else(|| {
            Error::numerical(
                "an element that depends on a state has no strain of its own",
                "let another element depend",
            )
        })?;
        Ok(Self { depending: Some(depending), ..Self::new(law, range)? })
    }

    /// About the fastest rate (1/s) at which the network answers a change of the stress; 0 where it has none.
    pub(super) fn fastest_rate_per_s(&self, range: RateRange) -> f64 {
        let rate = |body: &Body| {
            let mut sizes = Sizes { stiffness_pa: 0.0, viscosity_pa_s: f64::INFINITY, has_springpot: false };
            body.measure(&mut sizes);
            let springpot = if sizes.has_springpot { range.highest_per_s() } else { 0.0 };
            springpot.max(sizes.stiffness_pa / sizes.viscosity_pa_s)
        };
        self.bodies.iter().map(rate).fold(0.0, f64::max)
    }

    pub(super) fn prepare(&self, radau: &Radau, step_s: f64) -> NetworkStep {
        self.prepare_with(radau, step_s, Vector3::repeat(1.0))
    }

    /// The same where the stress of the element that depends is multiplied by factors at the stages.
    pub(super) fn prepare_with(&self, radau: &Radau, step_s: f64, at_stages: Vector3<f64>) -> NetworkStep {
        let of = |(place, body): (usize, &Body)| {
            let own = self.depending.filter(|(depending, _)| *depending == place);
            body.prepare(radau, step_s, Given::Stress, own.map(|(_, part)| Factors { part, at_stages }))
        };
        let bodies: Vec<BodyStep> = self.bodies.iter().enumerate().map(of).collect();
        NetworkStep { compliance: bodies.iter().map(|body| body.response).sum(), bodies }
    }

    /// Strain at the stages of the body whose element depends, given the stress there, after [`Self::begin`]; of the whole where none does.
    pub(super) fn strain_of_depending(&self, step: &NetworkStep, stress: &Vector3<f64>) -> Vector3<f64> {
        let all = self.bodies.iter().zip(&step.bodies).enumerate();
        let is_meant = |place: usize| self.depending.is_none_or(|(depending, _)| depending == place);
        all.filter(|(place, _)| is_meant(*place)).map(|(_, (body, step))| step.response * stress + body.history).sum()
    }

    /// Strain at the stages if the stress were zero.
    pub fn begin(&mut self, step: &NetworkStep) -> Vector3<f64> {
        self.bodies.iter_mut().zip(&step.bodies).map(|(body, step)| body.begin(step, Given::Stress)).sum()
    }

    /// Carries every body to the step's end, given the stress at the stages.
    pub(super) fn end(&mut self, step: &NetworkStep, stress: &Vector3<f64>) {
        for (body, step) in self.bodies.iter_mut().zip(&step.bodies) {
            body.end(step, Given::Stress, stress);
        }
    }
}

/// What an element amounts to.
enum Built {
    Rigid,
    WithoutResistance,
    Body(Kind),
}

/// Bodies of `elements` that are all given the same; `None` where one of them decides alone: one without resistance in series, a rigid one
/// in parallel. Those that add nothing (rigid in series, without resistance in parallel) are left out.
fn bodies(elements: &[Element], given: Given, range: RateRange) -> Option<Vec<Body>> {
    let mut found = Vec::with_capacity(elements.len());
    for element in elements {
        let built = match element {
            Element::Spring { modulus_pa } => spring(modulus_pa.value),
            Element::Dashpot { viscosity_pa_s } => dashpot(viscosity_pa_s.value),
            Element::Compliance { compliance_per_pa } => spring(1.0 / compliance_per_pa.value),
            Element::Retarded { compliance_per_pa, time_s } => {
                let modulus_pa = Dual::constant(1.0 / compliance_per_pa.value);
                // A body that never yields is rigid, whatever its time.
                let kelvin_voigt = Element::kelvin_voigt(modulus_pa, modulus_pa * time_s.value);
                found.extend(bodies(&[kelvin_voigt], given, range)?);
                continue;
            }
            Element::Springpot { modulus_pa, time_s, order } => {
                springpot(modulus_pa.value * time_s.value.powf(order.value), order.value, range)
            }
            Element::Series(inner) if given == Given::Stress => {
                found.extend(bodies(inner, given, range)?);
                continue;
            }
            Element::Parallel(inner) if given == Given::Strain => {
                found.extend(bodies(inner, given, range)?);
                continue;
            }
            Element::Series(inner) => match bodies(inner, Given::Stress, range) {
                None => Built::WithoutResistance,
                Some(inner) if inner.is_empty() => Built::Rigid,
                Some(inner) => Built::Body(Kind::Group(inner)),
            },
            Element::Parallel(inner) => match bodies(inner, Given::Strain, range) {
                None => Built::Rigid,
                Some(inner) if inner.is_empty() => Built::WithoutResistance,
                Some(inner) => Built::Body(Kind::Group(inner)),
            },
        };
        match (built, given) {
            (Built::Body(kind), _) => found.push(Body { kind, history: Vector3::zeros() }),
            (Built::Rigid, Given::Stress) | (Built::WithoutResistance, Given::Strain) => {}
            (Built::Rigid, Given::Strain) | (Built::WithoutResistance, Given::Stress) => return None,
        }
    }
    Some(found)
}

fn spring(modulus_pa: f64) -> Built {
    sized(modulus_pa, || Kind::Spring { modulus_pa })
}

fn dashpot(viscosity_pa_s: f64) -> Built {
    sized(viscosity_pa_s, || Kind::Dashpot { viscosity_pa_s, strain: 0.0 })
}

/// s = coefficient Dᵅε.
fn springpot(coefficient: f64, order: f64, range: RateRange) -> Built {
    if order >= 1.0 {
        dashpot(coefficient)
    } else if order <= 0.0 {
        spring(coefficient)
    } else {
        sized(coefficient, || Kind::Springpot(Springpot::new(coefficient, order, range)))
    }
}

fn sized(size: f64, kind: impl FnOnce() -> Kind) -> Built {
    if size == 0.0 {
        Built::WithoutResistance
    } else if size == f64::INFINITY {
        Built::Rigid
    } else {
        Built::Body(kind())
    }
}

/// What sets the rates of a body.
struct Sizes {
    /// Sum of the springs.
    stiffness_pa: f64,
    /// The smallest.
    viscosity_pa_s: f64,
    has_springpot: bool,
}

impl Body {
    fn measure(&self, sizes: &mut Sizes) {
        match &self.kind {
            Kind::Spring { modulus_pa } => sizes.stiffness_pa += modulus_pa,
            Kind::Dashpot { viscosity_pa_s, .. } => sizes.viscosity_pa_s = sizes.viscosity_pa_s.min(*viscosity_pa_s),
            Kind::Springpot(_) => sizes.has_springpot = true,
            Kind::Group(bodies) => bodies.iter().for_each(|body| body.measure(sizes)),
        }
    }

    fn prepare(&self, radau: &Radau, step_s: f64, given: Given, factors: Option<Factors>) -> BodyStep {
        let factors_of = |part: Option<usize>| {
            factors.filter(|own| own.part == part).map_or(Vector3::repeat(1.0), |own| own.at_stages)
        };
        let factors_here = factors_of(None);
        let [by_factor, over_factor] =
            [factors_here, factors_here.map(f64::recip)].map(|diagonal| Matrix3::from_diagonal(&diagonal));
        let alone = |response| BodyStep { response, parts: Parts::None, factors: factors_here };
        match (&self.kind, given) {
            (Kind::Spring { modulus_pa }, Given::Stress) => alone(over_factor / *modulus_pa),
            (Kind::Spring { modulus_pa }, Given::Strain) => alone(by_factor * *modulus_pa),
            (Kind::Dashpot { viscosity_pa_s, .. }, Given::Stress) => {
                alone(radau.matrix * over_factor * (step_s / viscosity_pa_s))
            }
            (Kind::Dashpot { viscosity_pa_s, .. }, Given::Strain) => {
                alone(by_factor * radau.inverse * (viscosity_pa_s / step_s))
            }
            (Kind::Springpot(springpot), _) => {
                let arms = springpot.prepare(radau, step_s);
                let stiffness = by_factor * arms.stiffness;
                let response = if given == Given::Stress { inverted(stiffness) } else { stiffness };
                BodyStep { response, parts: Parts::Arms(arms), factors: factors_here }
            }
            (Kind::Group(bodies), _) => {
                let of = |(place, body): (usize, &Body)| {
                    let own = factors.filter(|own| own.part == Some(place)).map(|own| Factors { part: None, ..own });
                    body.prepare(radau, step_s, given.other(), own)
                };
                let steps: Vec<BodyStep> = bodies.iter().enumerate().map(of).collect();
                let response = inverted(steps.iter().map(|step| step.response).sum());
                BodyStep { response, parts: Parts::Group(steps), factors: factors_here }
            }
        }
    }

    fn begin(&mut self, step: &BodyStep, given: Given) -> Vector3<f64> {
        self.history = match (&mut self.kind, &step.parts) {
            (Kind::Dashpot { strain, .. }, _) => match given {
                Given::Stress => Vector3::repeat(*strain),
                Given::Strain => step.response * Vector3::repeat(-*strain),
            },
            (Kind::Springpot(springpot), Parts::Arms(arms)) => {
                let stress = springpot.history_pa(arms).component_mul(&step.factors);
                if given == Given::Stress { -(step.response * stress) } else { stress }
            }
            (Kind::Group(bodies), Parts::Group(steps)) => {
                let parts = bodies.iter_mut().zip(steps).map(|(body, step)| body.begin(step, given.other()));
                -(step.response * parts.sum::<Vector3<f64>>())
            }
            _ => Vector3::zeros(),
        };
        self.history
    }

    fn end(&mut self, step: &BodyStep, given: Given, received: &Vector3<f64>) {
        let answer = step.response * received + self.history;
        let strain_of_it = if given == Given::Stress { &answer } else { received };
        match (&mut self.kind, &step.parts) {
            (Kind::Dashpot { strain, .. }, _) => *strain = strain_of_it[2],
            (Kind::Springpot(springpot), Parts::Arms(arms)) => springpot.advance(arms, strain_of_it),
            (Kind::Group(bodies), Parts::Group(steps)) => {
                for (body, step) in bodies.iter_mut().zip(steps) {
                    body.end(step, given.other(), &answer);
                }
            }
            _ => {}
        }
    }
}
