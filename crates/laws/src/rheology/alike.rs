//! Parts of a law that may trade places: two springpots in parallel are the same law with their parameters exchanged, so that data cannot say which of them is called by which name.

use base::parameter::ParameterSpec;

/// Parts of one kind that stand beside each other, in the order in which they are listed: the parameters of each, in the same order for all.
#[derive(Debug, Clone, PartialEq)]
pub struct Alike(pub Vec<Vec<ParameterSpec>>);

impl Alike {
    /// What parts are put in order by, at values of a part's parameters: its time, where it has a viscosity and a modulus; else how far its orders are below those of dashpots, which act faster in
    /// parallel; else the values themselves. It rises in the order in which the parts are listed.
    pub fn slowness(part: &[ParameterSpec], values: &[f64]) -> f64 {
        let sum = |unit: &str| -> f64 {
            let own = part.iter().zip(values).filter(|(spec, _)| spec.unit == unit);
            own.map(|(_, value)| value).sum()
        };
        let has = |unit: &str| part.iter().any(|spec| spec.unit == unit);
        match (has("Pa s"), has("1"), has("Pa")) {
            (true, _, true) => sum("Pa s") / sum("Pa"),
            (_, true, _) => -sum("1"),
            _ => values.iter().sum(),
        }
    }
}
