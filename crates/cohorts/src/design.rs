//! Design of a comparison: which experiment belongs to which specimen and group.

use std::collections::BTreeMap;

/// Labels of an experiment that assign it to a specimen and a group.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Labels {
    /// Name of the specimen. Several experiments of one specimen are repeats.
    pub specimen: String,
    /// Level of each key for this experiment, such as `bovine` for the species, in the order of the keys.
    pub levels: Vec<String>,
}

/// Group of experiments that have equal levels of each key, such as equal species and region.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Group {
    /// Name of the group: its levels, joined by commas.
    pub name: String,
    /// Index of the group's level among all levels of a key, one for each key.
    pub levels: Vec<usize>,
    /// Index of the group's stratum. Groups that have specimens in common form a stratum with one spread between specimens.
    pub stratum: usize,
}

/// Specimen with its experiments.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Specimen {
    /// Name of the specimen.
    pub name: String,
    /// Index of the stratum to which all groups of the specimen belong.
    pub stratum: usize,
    /// Indices of the specimen's experiments.
    pub experiments: Vec<usize>,
}

/// Experiments, sorted into specimens and groups.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Design {
    /// Levels of each key, sorted.
    pub keys: Vec<Vec<String>>,
    /// Groups with at least one experiment, sorted by their levels.
    pub groups: Vec<Group>,
    /// Specimens, sorted by name.
    pub specimens: Vec<Specimen>,
    /// Index of the group of each experiment.
    pub group_of: Vec<usize>,
    /// Number of strata, which are sets of groups with specimens in common.
    pub n_strata: usize,
}

impl Design {
    /// Assigns experiments to specimens and groups by their labels.
    pub fn new(labels: &[Labels]) -> Self {
        let n_keys = labels.first().map_or(0, |labels| labels.levels.len());
        let keys: Vec<Vec<String>> = (0..n_keys)
            .map(|key| {
                let mut levels: Vec<String> = labels.iter().map(|label| label.levels[key].clone()).collect();
                levels.sort();
                levels.dedup();
                levels
            })
            .collect();
        let level = |key: usize, name: &String| keys[key].binary_search(name).unwrap_or(0);
        let indices = |labels: &Labels| -> Vec<usize> {
            labels.levels.iter().enumerate().map(|(key, name)| level(key, name)).collect()
        };
        let mut places: BTreeMap<Vec<usize>, usize> = labels.iter().map(|label| (indices(label), 0)).collect();
        places.values_mut().enumerate().for_each(|(place, value)| *value = place);
        let group_of: Vec<usize> = labels.iter().map(|label| places[&indices(label)]).collect();
        let mut by_name: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
        for (experiment, label) in labels.iter().enumerate() {
            by_name.entry(&label.specimen).or_default().push(experiment);
        }
        let strata = strata(places.len(), by_name.values().map(|list| list.iter().map(|e| group_of[*e]).collect()));
        let n_strata = strata.iter().max().map_or(0, |last| last + 1);
        let groups = places.into_keys().zip(&strata).map(|(levels, stratum)| {
            let names: Vec<&str> = levels.iter().enumerate().map(|(key, level)| keys[key][*level].as_str()).collect();
            Group { name: names.join(","), stratum: *stratum, levels: levels.clone() }
        });
        let groups: Vec<Group> = groups.collect();
        let specimen = |(name, experiments): (&str, Vec<usize>)| Specimen {
            name: name.to_string(),
            stratum: experiments.first().map_or(0, |first| strata[group_of[*first]]),
            experiments,
        };
        let specimens = by_name.into_iter().map(specimen).collect();
        Self { groups, specimens, group_of, n_strata, keys }
    }

    /// Number of experiments.
    pub fn n_experiments(&self) -> usize {
        self.group_of.len()
    }

    /// Returns `true` if a specimen was measured more than once. Only then can the spread between repeats be estimated.
    pub fn has_repeats(&self) -> bool {
        self.specimens.iter().any(|specimen| specimen.experiments.len() > 1)
    }

    /// Number of specimens in a group.
    pub fn n_specimens(&self, group: usize) -> usize {
        let is_of = |specimen: &&Specimen| specimen.experiments.iter().any(|e| self.group_of[*e] == group);
        self.specimens.iter().filter(is_of).count()
    }
}

/// Index of the stratum of each group. Groups that have a specimen in common, directly or through other groups, form one stratum. `specimens` yields the
/// groups of each specimen.
fn strata(n_groups: usize, specimens: impl Iterator<Item = Vec<usize>>) -> Vec<usize> {
    let mut stratum: Vec<usize> = (0..n_groups).collect();
    for groups in specimens {
        let lowest = groups.iter().map(|group| stratum[*group]).min().unwrap_or(0);
        let joined: Vec<usize> = groups.iter().map(|group| stratum[*group]).collect();
        stratum
            .iter_mut()
            .filter(|level_place| joined.contains(level_place))
            .for_each(|level_place| *level_place = lowest);
    }
    let mut names = stratum.clone();
    names.sort_unstable();
    names.dedup();
    stratum.iter().map(|index| names.binary_search(index).unwrap_or(0)).collect()
}
