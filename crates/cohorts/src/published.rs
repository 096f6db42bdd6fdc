//! Published parameter values, shown beside the groups for comparison only.

use documents::groups::Published;

use posterior::prior::PriorSet;

/// Priors from one publication each: name of the prior, name of the publication in figures, and species.
const PUBLICATIONS: [(&str, &str, &str); 6] = [
    ("wang-2013", "Wang 2013", "porcine"),
    ("sharif-kashani-2011", "Sharif-Kashani 2011", "porcine"),
    ("lee-1994", "Lee 1994", "porcine"),
    ("nickerson-2008-porcine", "Nickerson 2008", "porcine"),
    ("nickerson-2008-bovine", "Nickerson 2008", "bovine"),
    ("aboulatta-2021", "Aboulatta 2021", "porcine"),
];

/// Published values of the named parameters, from the embedded priors of publications. Values that a prior assumes without publication are left out.
pub fn published_values(parameters: &[&str]) -> Vec<Published> {
    let mut all = Vec::new();
    for (name, source, species) in PUBLICATIONS {
        let Ok(set) = PriorSet::named(name) else { continue };
        let Ok(document) = set.text().parse::<toml::Table>() else { continue };
        for parameter in parameters {
            // The value is the published number, not the centre of the prior that is assumed around it.
            let of_table = |key: &str| document.get(*parameter)?.get(key)?.as_float();
            let Some(value) = of_table("mean").or_else(|| of_table("median")) else { continue };
            let statement = set.get(parameter).map_or_else(String::new, |prior| prior.source.clone());
            if statement.starts_with("published") {
                let (parameter, source, species) = ((*parameter).into(), source.into(), species.into());
                all.push(Published { parameter, source, species, value, statement });
            }
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compares the values with Table I of the paper and its two columns of values from other publications. Further publications list only parameters that
    /// they measured.
    #[test]
    fn values_are_the_published_ones() {
        let all = published_values(&["young_modulus_pa", "viscosity_1_pa_s", "viscosity_2_pa_s"]);
        let values = |source: &str| -> Vec<f64> {
            all.iter().filter(|published| published.source == source).map(|published| published.value).collect()
        };
        assert_eq!(values("Wang 2013"), [3.527, 1.402, 47.37]);
        assert_eq!(values("Sharif-Kashani 2011"), [1.66, 2.4, 70.0]);
        assert_eq!(values("Lee 1994"), [0.937, 0.599, 8.402]);
        // Young's modulus is the published shear modulus times 2 (1 + 0.48).
        let expected = [2.96 * 2.8, 2.96 * 7.0];
        let found = values("Nickerson 2008");
        assert!(found.len() == 2 && found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 0.01), "{found:?}");
        assert_eq!(values("Aboulatta 2021").len(), 2);
    }
}
