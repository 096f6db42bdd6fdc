//! Interchangeable parts of a law. Two springpots in parallel give an identical law when their parameters are exchanged. Data therefore cannot tell which
//! name belongs to which part.

use base::parameter::ParameterSpec;

/// Sibling parts of one kind, in the network's order. All parts list their parameters in one order.
#[derive(Debug, Clone, PartialEq)]
pub struct InterchangeableParts(pub Vec<Vec<ParameterSpec>>);

impl InterchangeableParts {
    /// Number by which parts are ordered, smallest first, from the values (SI) of one part. With a viscosity and a modulus it is the part's time. With a
    /// springpot it is minus the order, because the springpot of higher order acts faster. Otherwise it is the modulus or viscosity itself.
    pub fn slowness(part: &[ParameterSpec], values: &[f64]) -> f64 {
        let sum = |unit: &str| -> f64 {
            let filter = part.iter().zip(values).filter(|(spec, _)| spec.unit == unit);
            filter.map(|(_, value)| value).sum()
        };
        let has = |unit: &str| part.iter().any(|spec| spec.unit == unit);
        match (has("Pa s"), has("1"), has("Pa")) {
            (true, _, true) => sum("Pa s") / sum("Pa"),
            (_, true, _) => -sum("1"),
            _ => values.iter().sum(),
        }
    }
}
