//! Coordinates that distinguish a law from all others of its kind. By similarity there is one coordinate fewer than parameters of
//! the law.
//!
//! The first body's modulus E is the unit of stress. Under a given force, laws then differ by their times c/E (viscosities divided by E),
//! by their ratios of moduli and by their distance from the linear law. E itself only multiplies all displacements by 1/E, so it is no
//! coordinate. Data usually determine E best.

use base::number::{Dual, Scalar};
use laws::rheology::Element;
use laws::stages::{NonlinearFamily, Nonlinearity, Spatial, Stages};
use std::f64::consts::{LN_2, PI};

/// Value of β (x/R)² at which stiffening becomes visible. β is the stiffening coefficient, x the elastic displacement and R the robot's
/// radius.
const STIFFENING_UNIT: f64 = 0.3;
/// Yield stress, divided by the force per area of the robot's surface, at which yielding becomes visible.
const YIELD_UNIT: f64 = 0.003;

/// Properties that all laws in one space of coordinates share.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct CoordinateKind {
    family: NonlinearFamily,
    /// Structure of the law, as the kinds of its elements in order.
    shape: Vec<LawToken>,
    /// Bits of the displacement per force, and of the nonlinear law's constant.
    constants: [u64; 2],
}

impl CoordinateKind {
    /// Returns the distance of the last (nonlinear) coordinate from its value at the linear law, where the excess vanishes.
    pub fn beyond_null<N: Scalar>(&self, last: N) -> N {
        match self.family {
            NonlinearFamily::ShearThinning => N::constant(1.0) - last,
            NonlinearFamily::StrainStiffening | NonlinearFamily::YieldStress => last,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum LawToken {
    Spring,
    Dashpot,
    Series,
    Parallel,
    End,
}

/// Sizes of a record and of its robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct CoordinateSizes {
    /// Largest force in N.
    pub force_n: f64,
    /// Largest |∫F dt| from the record's start to any row, in N·s.
    pub impulse_n_s: f64,
    /// Displacement per force at unit creep compliance, in 1/m.
    pub compliance_per_m: f64,
}

impl CoordinateSizes {
    /// Returns (x/R)² at unit modulus, the squared ratio of elastic displacement to robot radius. x is F K, with F the largest force and K
    /// the displacement per force (1/m). R = 1/(2πK) is the radius of a sphere in an incompressible gel.
    fn squared_strain(self) -> f64 {
        (2.0 * PI * self.compliance_per_m.powi(2) * self.force_n).powi(2)
    }

    /// Returns the largest force divided by the area of the robot's surface, F/(4πR²) with R the robot's radius, in Pa.
    fn surface_pa(self) -> f64 {
        PI * self.compliance_per_m.powi(2) * self.force_n
    }
}

/// Kind and coordinates of a law.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CoordinatePlace {
    pub kind: CoordinateKind,
    /// Logarithms of the law's other moduli divided by the first body's modulus and of its viscosities divided by this modulus (s), in the
    /// order of the law. The last entry is the nonlinear coordinate.
    pub coordinates: Vec<Dual>,
    pub modulus_pa: Dual,
}

impl CoordinatePlace {
    /// Returns the coordinates of a law. `None` if the stages have effects other than a nonlinear law, or if the law has elements
    /// that no coordinate describes.
    pub fn of(stages: &Stages, sizes: CoordinateSizes) -> Option<Self> {
        let plain = Stages::of_law(Vec::new());
        let Some(Spatial::Nonlinear(law)) = stages.spatial else { return None };
        if stages.load != plain.load || !stages.softening_rate_per_s.is_constant(0.0) || stages.poisson_ratio.is_some()
        {
            return None;
        }
        let (mut shape, mut numbers) = (Vec::with_capacity(8), Vec::with_capacity(8));
        read(&stages.law, &mut shape, &mut numbers)?;
        let first = first_body(&shape)?;
        let modulus_pa = numbers[first];
        if !numbers.iter().all(|number| number.value > 0.0 && number.value.is_finite()) {
            return None;
        }
        let others = numbers.iter().enumerate().filter(|(k, _)| *k != first);
        let mut coordinates: Vec<Dual> = others.map(|(_, number)| (*number / modulus_pa).ln()).collect();
        let constant = match law {
            Nonlinearity::StrainStiffening { .. } => 0.0,
            Nonlinearity::ShearThinning { reference_stress_pa, .. } => {
                if reference_stress_pa.derivative != 0.0 {
                    return None;
                }
                reference_stress_pa.value
            }
            Nonlinearity::YieldStress { smoothing, .. } => smoothing,
        };
        coordinates.push(coordinate_of(law, modulus_pa, sizes));
        if !coordinates.iter().all(|x| x.value.is_finite()) {
            return None;
        }
        let constants = [sizes.compliance_per_m.to_bits(), constant.to_bits()];
        Some(Self { kind: CoordinateKind { family: law.family(), shape, constants }, coordinates, modulus_pa })
    }
}

/// Returns the last coordinate of a law. It is a function of the nonlinear parameter that is smooth at the linear law.
fn coordinate_of(law: Nonlinearity<Dual>, modulus_pa: Dual, sizes: CoordinateSizes) -> Dual {
    match law {
        Nonlinearity::StrainStiffening { coefficient } => {
            let scale = sizes.squared_strain() / STIFFENING_UNIT;
            (coefficient * scale / (modulus_pa * modulus_pa) + Dual::ONE).ln()
        }
        Nonlinearity::ShearThinning { index, .. } => index,
        Nonlinearity::YieldStress { stress_pa, .. } => {
            (stress_pa * (1.0 / (YIELD_UNIT * sizes.surface_pa())) + Dual::ONE).ln()
        }
    }
}

/// Returns stages at other coordinates of the same kind of law, with a modulus of 1 Pa for the first body.
pub(super) fn stages_at(template: &Stages, coordinates: &[f64], sizes: CoordinateSizes) -> Option<Stages> {
    let (mut shape, mut numbers) = (Vec::new(), Vec::new());
    read(&template.law, &mut shape, &mut numbers)?;
    let first = first_body(&shape)?;
    let (of_nonlinearity, of_law) = coordinates.split_last()?;
    let mut of_law = of_law.iter().map(|x| x.exp());
    let mut values = Vec::with_capacity(numbers.len());
    for k in 0..numbers.len() {
        values.push(if k == first { 1.0 } else { of_law.next()? });
    }
    let grown = of_nonlinearity.exp_m1().max(0.0);
    let law = match template.spatial {
        Some(Spatial::Nonlinear(Nonlinearity::StrainStiffening { .. })) => {
            Nonlinearity::StrainStiffening { coefficient: (grown * STIFFENING_UNIT / sizes.squared_strain()).into() }
        }
        Some(Spatial::Nonlinear(Nonlinearity::ShearThinning { reference_stress_pa, .. })) => {
            Nonlinearity::ShearThinning { index: of_nonlinearity.min(1.0).into(), reference_stress_pa }
        }
        Some(Spatial::Nonlinear(Nonlinearity::YieldStress { smoothing, .. })) => {
            Nonlinearity::YieldStress { stress_pa: (grown * YIELD_UNIT * sizes.surface_pa()).into(), smoothing }
        }
        _ => return None,
    };
    let mut stages = Stages::of_law(with_numbers(&template.law, &mut values.into_iter())?);
    stages.spatial = Some(Spatial::Nonlinear(law));
    Some(stages)
}

/// Returns the width of the largest boxes in every coordinate, and the ends of the last coordinate. Boxes end where a time passes a power
/// of two, because the lengths of the stepper's steps jump there.
pub(super) fn widths(kind: &CoordinateKind) -> (Vec<f64>, [f64; 2]) {
    let (of_nonlinearity, ends) = match kind.family {
        NonlinearFamily::StrainStiffening => (0.5, [0.0, 6.0]),
        NonlinearFamily::ShearThinning => (0.2, [0.2, 1.0]),
        NonlinearFamily::YieldStress => (0.2, [0.0, 7.2]),
    };
    let first = first_body(&kind.shape);
    let (mut widths, mut number, mut is_inside) = (Vec::with_capacity(8), 0, false);
    for tag in &kind.shape {
        match tag {
            LawToken::Parallel => is_inside = true,
            LawToken::Series | LawToken::End => is_inside = false,
            LawToken::Spring | LawToken::Dashpot => {
                // A dashpot in series allows a wider box, because trajectories depend smoothly on its time, unless the gel may
                // come to rest.
                let is_wide = *tag == LawToken::Dashpot && !is_inside && kind.family != NonlinearFamily::YieldStress;
                if first != Some(number) {
                    widths.push(if is_wide { 2.0 * LN_2 } else { LN_2 });
                }
                number += 1;
            }
        }
    }
    widths.push(of_nonlinearity);
    (widths, ends)
}

/// Returns the typical displacement (m) of trajectories, for a first body of unit modulus.
pub(super) fn amplitude_m(stages: &Stages, sizes: CoordinateSizes) -> f64 {
    let of = |element: &Element| match element {
        Element::Dashpot { viscosity_pa_s } => sizes.impulse_n_s / viscosity_pa_s.value,
        Element::Spring { modulus_pa } => sizes.force_n / modulus_pa.value,
        Element::Parallel(parts) => parts
            .iter()
            .map(|part| if let Element::Spring { modulus_pa } = part { sizes.force_n / modulus_pa.value } else { 0.0 })
            .sum(),
        _ => 0.0,
    };
    sizes.compliance_per_m * stages.law.iter().map(of).sum::<f64>()
}

pub fn read(elements: &[Element], shape: &mut Vec<LawToken>, numbers: &mut Vec<Dual>) -> Option<()> {
    for element in elements {
        match element {
            Element::Spring { modulus_pa } => {
                shape.push(LawToken::Spring);
                numbers.push(*modulus_pa);
            }
            Element::Dashpot { viscosity_pa_s } => {
                shape.push(LawToken::Dashpot);
                numbers.push(*viscosity_pa_s);
            }
            Element::Series(parts) | Element::Parallel(parts) => {
                shape.push(if matches!(element, Element::Series(_)) { LawToken::Series } else { LawToken::Parallel });
                read(parts, shape, numbers)?;
                shape.push(LawToken::End);
            }
            _ => return None,
        }
    }
    Some(())
}

/// Returns the index, in the list of the law's moduli and viscosities, of the first spring inside a body.
pub(super) fn first_body(shape: &[LawToken]) -> Option<usize> {
    let (mut number, mut is_inside) = (0, false);
    for tag in shape {
        match tag {
            LawToken::Parallel => is_inside = true,
            LawToken::Spring if is_inside => return Some(number),
            LawToken::Spring | LawToken::Dashpot => number += 1,
            LawToken::Series | LawToken::End => {}
        }
    }
    None
}

pub(super) fn with_numbers(elements: &[Element], values: &mut impl Iterator<Item = f64>) -> Option<Vec<Element>> {
    let mut made = Vec::with_capacity(elements.len());
    for element in elements {
        made.push(match element {
            Element::Spring { .. } => Element::Spring { modulus_pa: values.next()?.into() },
            Element::Dashpot { .. } => Element::Dashpot { viscosity_pa_s: values.next()?.into() },
            Element::Series(parts) => Element::Series(with_numbers(parts, values)?),
            Element::Parallel(parts) => Element::Parallel(with_numbers(parts, values)?),
            _ => return None,
        });
    }
    Some(made)
}
