//! Interchangeable parts of a law. For example, exchanging the parameters of two springpots in parallel leaves the law unchanged.
//! Data therefore cannot determine which parameters belong to which springpot.

use base::parameter::ParameterSpec;

/// Group of interchangeable parts, in the order of the network. Each entry lists the parameters of one part. All parts list their
/// parameters in the same order.
#[derive(Debug, Clone, PartialEq)]
pub struct InterchangeableParts(pub Vec<Vec<ParameterSpec>>);

impl InterchangeableParts {
    /// Returns the number by which interchangeable parts are sorted, smallest first. `values` are the values (SI) of the part's
    /// parameters. For a viscosity and a modulus the number is the retardation time. For a springpot it is minus the order,
    /// because a springpot of higher order acts faster. For a single spring or dashpot it is the modulus or viscosity.
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
