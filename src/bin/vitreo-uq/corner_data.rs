//! Compares the data that the posteriors of a corner plot were fitted to. Posteriors of different data differ even if their models are equal.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};
use vitreo_uq::base::files::{Content, read_if_there};
use vitreo_uq::jobs::artefacts::is_measurement_file;
use vitreo_uq::posterior::study::{POSTERIOR_NAME, Provenance, WithProvenance};

/// The data that a posterior was fitted to.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct FittedData {
    /// Numbers of the fitted cycles.
    pub fitted_cycles: Vec<u32>,
    /// SHA-256 hash of each of the experiment's files, by file name.
    pub inputs_sha256: BTreeMap<String, String>,
}

/// Fields of `posterior.json` that describe the data.
#[derive(Deserialize)]
struct PosteriorData {
    heldout: OfHeldout,
}

#[derive(Deserialize)]
struct OfHeldout {
    fitted_cycles: Vec<u32>,
}

impl FittedData {
    /// Reads the data of a revision's posterior. Returns `None` if the posterior's document does not list its data.
    pub fn of_revision(dir: &Path) -> Option<Self> {
        let bytes = read_if_there(&dir.join(POSTERIOR_NAME), Content::Document)?;
        let document: WithProvenance<PosteriorData> = serde_json::from_slice(&bytes).ok()?;
        let Provenance { inputs_sha256, .. } = document.provenance;
        Some(Self {
            fitted_cycles: document.body.heldout.fitted_cycles,
            inputs_sha256: inputs_sha256.into_iter().filter(|(name, _)| is_measurement_file(name)).collect(),
        })
    }

    /// Text of the fitted cycles, such as "cycle 1", "cycles 1–3" or "cycles 1, 3".
    pub fn cycles(&self) -> String {
        let mut runs: Vec<[u32; 2]> = Vec::new();
        for cycle in &self.fitted_cycles {
            match runs.last_mut() {
                Some([_, last]) if *last + 1 == *cycle => *last = *cycle,
                _ => runs.push([*cycle, *cycle]),
            }
        }
        let run =
            |[first, last]: &[u32; 2]| if first == last { first.to_string() } else { format!("{first}–{last}") };
        let list: Vec<String> = runs.iter().map(run).collect();
        format!("cycle{} {}", if self.fitted_cycles.len() == 1 { "" } else { "s" }, list.join(", "))
    }
}

/// Returns a legend text for each posterior, and a note for the figure. `None` if all posteriors are known to have equal data.
pub fn describe_data_differences(names: &[&str], data: &[Option<FittedData>]) -> Option<(Vec<String>, String)> {
    let first = data.first()?;
    if data.iter().all(|fitted_data| fitted_data == first) {
        return None;
    }
    let words = |fitted_data: &Option<FittedData>| match fitted_data {
        Some(entry) => format!("fitted to {}", entry.cycles()),
        None => "unknown data".to_string(),
    };
    let known: Vec<&FittedData> = data.iter().flatten().collect();
    let is_one_measurement = known.windows(2).all(|pair| pair[0].inputs_sha256 == pair[1].inputs_sha256);
    let of = if is_one_measurement { "" } else { " of its own measurement" };
    let each: Vec<String> = names
        .iter()
        .zip(data)
        .map(|(name, fitted_data)| {
            format!("{name}: {}{}", words(fitted_data), if fitted_data.is_some() { of } else { "" })
        })
        .collect();
    let advice = if is_one_measurement && known.len() == data.len() {
        "; `vitreo-uq ladder` compares revisions on the same cycles"
    } else {
        ""
    };
    let text = format!(
        "these posteriors were fitted to different data, so the model is not their only difference: {}{advice}",
        each.join("; ")
    );
    Some((data.iter().map(words).collect(), text))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn data(cycles: &[u32], hash: &str) -> Option<FittedData> {
        let inputs_sha256 = [("trajectory.csv".to_string(), hash.to_string())].into();
        Some(FittedData { fitted_cycles: cycles.to_vec(), inputs_sha256 })
    }

    #[test]
    fn differences_are_said_and_nothing_else() {
        let names = ["a m0", "a m1"];
        assert_eq!(describe_data_differences(&names, &[data(&[1], "x"), data(&[1], "x")]), None);
        assert_eq!(describe_data_differences(&names, &[None, None]), None);
        let (legend, text) = describe_data_differences(&names, &[data(&[1], "x"), data(&[1, 2, 3, 5], "x")]).unwrap();
        assert_eq!(legend, ["fitted to cycle 1", "fitted to cycles 1–3, 5"]);
        assert!(text.contains("a m0: fitted to cycle 1; a m1") && text.contains("ladder"), "{text}");
        let (_, text) = describe_data_differences(&names, &[data(&[1], "x"), data(&[1], "y")]).unwrap();
        assert!(text.contains("its own measurement") && !text.contains("ladder"), "{text}");
        let (legend, _) = describe_data_differences(&names, &[data(&[1], "x"), None]).unwrap();
        assert_eq!(legend[1], "unknown data");
    }
}
