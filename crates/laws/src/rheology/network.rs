//! Base laws that users write in `model.toml` as a tree of springs, dashpots and springpots (formats §2).
//!
//! ```toml
//! [base.network]
//! series = [
//!     { parallel = [{ spring = "gel" }, { springpot = "mesh" }] },
//!     { dashpot = "flow" },
//! ]
//! ```
//!
//! A table holds one key: `series` or `parallel` with a list of tables, or an element with its name. Names define the parameters:
//! a spring `gel` has `gel_modulus_pa`, a dashpot `flow` has `flow_viscosity_pa_s`. A springpot `mesh` has the order `mesh_order`
//! (α) and the modulus `mesh_modulus_pa` (G) at one second. Its stress is G (1 s)ᵅ Dᵅε, with Dᵅε the fractional derivative of the
//! strain. Two elements of one kind with equal names share their parameters. The names cannot collide with other parameters:
//! noise parameters have other endings, and parameters of effects contain a dot.

use std::path::Path;
use std::sync::{Mutex, PoisonError};

use super::{Element, ElementPlace, InterchangeableParts};
use base::distribution::Distribution;
use base::error::Result;
use base::number::Dual;
use base::parameter::{ParameterSpec, Support};
use base::toml_input::{TomlInput, TomlTable};

const SPRING: &str = "spring";
const DASHPOT: &str = "dashpot";
const SPRINGPOT: &str = "springpot";
const SERIES: &str = "series";
const PARALLEL: &str = "parallel";
const KEYS: [&str; 5] = [SPRING, DASHPOT, SPRINGPOT, SERIES, PARALLEL];
const EXAMPLE: &str = "{ spring = \"gel\" }";
/// Largest number of elements of a network. It keeps the parameters of network, effects and noise within the 256 dimensions of
/// the Sobol sequences.
const MAX_ELEMENTS: usize = 64;

/// All distinct networks that the program has read so far.
static NETWORKS: Mutex<Vec<&'static Network>> = Mutex::new(Vec::new());

/// Constitutive law as a tree of named springs, dashpots and springpots.
#[derive(Debug, PartialEq)]
pub struct Network {
    root: Node,
    parameters: Vec<ParameterSpec>,
}

#[derive(Debug, Clone, PartialEq)]
enum Node {
    /// Element of the network. `first` is the index of its first parameter.
    Leaf {
        kind: Kind,
        name: String,
        first: usize,
    },
    Series(Vec<Node>),
    Parallel(Vec<Node>),
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    Spring,
    Dashpot,
    Springpot,
}

impl Kind {
    fn key(self) -> &'static str {
        match self {
            Self::Spring => SPRING,
            Self::Dashpot => DASHPOT,
            Self::Springpot => SPRINGPOT,
        }
    }

    /// Suffixes of the names of the element's parameters, each with its unit and support.
    fn parameters(self) -> &'static [(&'static str, &'static str, Support)] {
        const MODULUS: (&str, &str, Support) = ("modulus_pa", "Pa", Support::POSITIVE);
        match self {
            Self::Spring => &[MODULUS],
            Self::Dashpot => &[("viscosity_pa_s", "Pa s", Support::POSITIVE)],
            Self::Springpot => &[MODULUS, ("order", "1", Support { lower: 0.0, upper: 1.0 })],
        }
    }
}

/// State while a network is read: each element so far with the index of its first parameter, and the names of the parameters.
#[derive(Default)]
struct Reader {
    elements: Vec<(String, Kind, usize)>,
    parameters: Vec<(String, &'static str, Support)>,
    /// Number of elements read so far. An element with a repeated name counts each time.
    n_bodies: usize,
}

impl Network {
    /// Reads a network from the text of its table, for models without a `model.toml`. `file` only appears in error messages.
    ///
    /// ```
    /// use vitreo_uq_laws::rheology::{BaseLaw, Network};
    /// let text = "series = [{ parallel = [{ spring = \"gel\" }, { springpot = \"mesh\" }] }, { dashpot = \"flow\" }]";
    /// let law = BaseLaw::Network(Network::from_text("network.toml".as_ref(), text)?);
    /// let names: Vec<&str> = law.parameters().iter().map(|parameter| parameter.name).collect();
    /// assert_eq!(names, ["gel_modulus_pa", "mesh_modulus_pa", "mesh_order", "flow_viscosity_pa_s"]);
    /// # Ok::<(), base::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`base::Error::Input`] with the file, the line, the key and what to do.
    pub fn from_text(file: &Path, text: &str) -> Result<&'static Self> {
        let document = TomlInput::parse(file, text)?;
        Self::from_toml(&document.root())
    }

    /// Reads the table `[base.network]`. Equal networks share one reference.
    ///
    /// # Errors
    /// [`base::Error::Input`] with the file, the line, the key and what to do.
    pub fn from_toml(table: &TomlTable<'_>) -> Result<&'static Self> {
        let mut reader = Reader::default();
        let root = reader.node(table)?;
        // A network lives as long as the program, because laws are copied into every forward model and thread. Each distinct
        // network is stored once, so that reading a file again needs no more memory.
        let mut networks = NETWORKS.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = networks.iter().find(|network| network.root == root) {
            return Ok(known);
        }
        let spec = |(name, unit, support): (String, &'static str, Support)| {
            ParameterSpec::new(Box::leak(name.into_boxed_str()), "", unit, support)
        };
        let parameters = reader.parameters.into_iter().map(spec).collect();
        let network: &'static Self = Box::leak(Box::new(Self { root, parameters }));
        networks.push(network);
        Ok(network)
    }

    /// Returns the network as the TOML table that [`Self::from_toml`] reads.
    pub fn to_toml_value(&self) -> toml::Value {
        self.root.to_toml_value()
    }

    /// Returns the parameters of the network's elements, in the order in which the elements first occur.
    pub fn parameters(&self) -> &[ParameterSpec] {
        &self.parameters
    }

    /// Returns the place of the element whose modulus or viscosity is the parameter `name`, as [`super::BaseLaw::leaf`] does.
    pub(super) fn leaf(&self, name: &str) -> Option<ElementPlace> {
        let is_it = |node: &Node| match node {
            Node::Leaf { kind, name: label, .. } => name == format!("{label}_{}", kind.parameters()[0].0),
            Node::Series(_) | Node::Parallel(_) => false,
        };
        let bodies = match &self.root {
            Node::Series(nodes) => &nodes[..],
            node => std::slice::from_ref(node),
        };
        let places = |(body, node): (usize, &Node)| -> Vec<ElementPlace> {
            match node {
                Node::Parallel(parts) => {
                    let filter = parts.iter().enumerate().filter(|(_, part)| is_it(part));
                    filter.map(|(part, _)| ElementPlace { body, part: Some(part) }).collect()
                }
                node => is_it(node).then_some(ElementPlace { body, part: None }).into_iter().collect(),
            }
        };
        let found: Vec<ElementPlace> = bodies.iter().enumerate().flat_map(places).collect();
        match (&found[..], self.root.count(&is_it)) {
            ([leaf], 1) => Some(*leaf),
            _ => None,
        }
    }

    /// Returns the network's elements, which are in series, for parameter values in SI units and in the order of
    /// [`Self::parameters`].
    pub fn elements(&self, parameters: &[Dual]) -> Vec<Element> {
        match &self.root {
            Node::Series(nodes) => nodes.iter().map(|node| node.element(parameters)).collect(),
            node => vec![node.element(parameters)],
        }
    }

    /// Returns the groups of interchangeable parts of the network. Parts with an element that occurs twice in the network are
    /// omitted.
    pub(super) fn interchangeable_parts(&self) -> Vec<InterchangeableParts> {
        let (mut found, mut places) = (Vec::new(), Vec::new());
        self.root.add_interchangeable(&mut found);
        self.root.shape(&mut places);
        let is_single = |place: &usize| places.iter().filter(|other| *other == place).count() == 1;
        found.retain(|parts: &Vec<Vec<usize>>| parts.iter().flatten().all(is_single));
        let specs = |part: Vec<usize>| part.into_iter().map(|place| self.parameters[place]).collect();
        found.into_iter().map(|parts| InterchangeableParts(parts.into_iter().map(specs).collect())).collect()
    }

    /// Returns the default prior of one parameter, and the source of the prior's numbers; `None` for an unknown name.
    pub(super) fn default_prior(&self, name: &str) -> Option<(Distribution, &'static str)> {
        let spec = self.parameters.iter().find(|spec| spec.name == name)?;
        let wide = |median: f64| Distribution::LogNormal { median, log_sd: 2.0 };
        Some(match spec.unit {
            "Pa" => (wide(3.0), "chosen: median 3 Pa as for soft gels, standard deviation a factor of 7"),
            "Pa s" => (wide(10.0), "chosen: median 10 Pa s (seconds at 3 Pa), standard deviation a factor of 7"),
            _ => (
                Distribution::Uniform { lower: 0.05, upper: 0.95 },
                "chosen: any order from near 0 (a spring) to near 1 (a dashpot)",
            ),
        })
    }
}

impl Reader {
    fn node(&mut self, table: &TomlTable<'_>) -> Result<Node> {
        table.only(&KEYS)?;
        let mut keys = table.keys();
        let (Some(key), None) = (keys.next(), keys.next()) else {
            let found: Vec<&str> = table.keys().collect();
            return Err(table.refuse_whole(
                format!("found {} keys where one is expected: {}", found.len(), found.join(", ")),
                format!("give one of {}, as in `{EXAMPLE}`; join several by `series` or `parallel`", KEYS.join(", ")),
            ));
        };
        let kind = match key {
            SPRING => Kind::Spring,
            DASHPOT => Kind::Dashpot,
            SPRINGPOT => Kind::Springpot,
            SERIES => return Ok(Node::Series(self.nodes(table, key)?)),
            _ => return Ok(Node::Parallel(self.nodes(table, key)?)),
        };
        self.leaf(table, key, kind)
    }

    fn nodes(&mut self, table: &TomlTable<'_>, key: &str) -> Result<Vec<Node>> {
        let example = format!("{key} = [{EXAMPLE}, {{ dashpot = \"flow\" }}]");
        let parts = table.tables(key, &example)?;
        if parts.is_empty() {
            return Err(table.refuse(key, "the list is empty", format!("write `{example}`")));
        }
        parts.iter().map(|part| self.node(part)).collect()
    }

    fn leaf(&mut self, table: &TomlTable<'_>, key: &str, kind: Kind) -> Result<Node> {
        let name = table.required_text(key, EXAMPLE)?;
        self.n_bodies += 1;
        if self.n_bodies > MAX_ELEMENTS {
            return Err(table.refuse(
                key,
                format!("this is element {} of the network", self.n_bodies),
                format!(
                    "give a network of at most {MAX_ELEMENTS} elements; creep measurements can distinguish only a few"
                ),
            ));
        }
        if !is_identifier(&name) {
            return Err(table.refuse(
                key,
                format!("`{name}` cannot be the first part of a parameter's name"),
                "use lower-case letters, digits and underscores, a letter first, as in `gel`",
            ));
        }
        let known = self.elements.iter().find(|(known, ..)| *known == name);
        let first = match known {
            Some((_, same, first)) if *same == kind => *first,
            Some((_, other, _)) => {
                return Err(table.refuse(
                    key,
                    format!("`{name}` is already the name of a {}", other.key()),
                    "give each element its own name; a repeated name means a repeated element",
                ));
            }
            None => self.new_element(&name, kind),
        };
        Ok(Node::Leaf { kind, name, first })
    }

    fn new_element(&mut self, name: &str, kind: Kind) -> usize {
        let first = self.parameters.len();
        self.elements.push((name.to_string(), kind, first));
        let parameters = kind.parameters().iter();
        self.parameters.extend(parameters.map(|(ending, unit, support)| (format!("{name}_{ending}"), *unit, *support)));
        first
    }
}

pub(super) fn is_identifier(name: &str) -> bool {
    name.starts_with(|first: char| first.is_ascii_lowercase())
        && name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
}

impl Node {
    /// Number of elements for which `is_so` returns `true`.
    fn count(&self, is_so: &dyn Fn(&Self) -> bool) -> usize {
        match self {
            Self::Leaf { .. } => usize::from(is_so(self)),
            Self::Series(nodes) | Self::Parallel(nodes) => nodes.iter().map(|node| node.count(is_so)).sum(),
        }
    }

    fn element(&self, parameters: &[Dual]) -> Element {
        let all = |nodes: &[Node]| nodes.iter().map(|node| node.element(parameters)).collect();
        match self {
            Self::Series(nodes) => Element::Series(all(nodes)),
            Self::Parallel(nodes) => Element::Parallel(all(nodes)),
            Self::Leaf { kind, first, .. } => match kind {
                Kind::Spring => Element::Spring { modulus_pa: parameters[*first] },
                Kind::Dashpot => Element::Dashpot { viscosity_pa_s: parameters[*first] },
                Kind::Springpot => Element::Springpot {
                    modulus_pa: parameters[*first],
                    time_s: Dual::ONE,
                    order: parameters[*first + 1],
                },
            },
        }
    }

    /// Returns a text that describes the structure of the subtree without names. Siblings are sorted, so that their order in the
    /// file does not matter. The indices of the parameters are added to `places` in the sorted order.
    fn shape(&self, places: &mut Vec<usize>) -> String {
        let (key, nodes) = match self {
            Self::Leaf { kind, first, .. } => {
                places.extend((0..kind.parameters().len()).map(|place| first + place));
                return kind.key().into();
            }
            Self::Series(nodes) => (SERIES, nodes),
            Self::Parallel(nodes) => (PARALLEL, nodes),
        };
        let mut parts: Vec<(String, Vec<usize>)> = nodes.iter().map(Self::shape_and_places).collect();
        parts.sort();
        places.extend(parts.iter().flat_map(|(_, part)| part));
        format!("{key}({})", parts.into_iter().map(|(shape, _)| shape).collect::<Vec<_>>().join(","))
    }

    fn shape_and_places(&self) -> (String, Vec<usize>) {
        let mut places = Vec::new();
        (self.shape(&mut places), places)
    }

    /// Adds every group of siblings of equal structure in the subtree to `found`. A group lists the parameter indices of each
    /// sibling.
    fn add_interchangeable(&self, found: &mut Vec<Vec<Vec<usize>>>) {
        let (Self::Series(nodes) | Self::Parallel(nodes)) = self else { return };
        let mut groups: Vec<(String, Vec<Vec<usize>>)> = Vec::new();
        for (shape, places) in nodes.iter().map(Self::shape_and_places) {
            match groups.iter_mut().find(|(known, _)| *known == shape) {
                Some((_, parts)) => parts.push(places),
                None => groups.push((shape, vec![places])),
            }
        }
        found.extend(groups.into_iter().map(|(_, parts)| parts).filter(|parts| parts.len() > 1));
        nodes.iter().for_each(|node| node.add_interchangeable(found));
    }

    fn to_toml_value(&self) -> toml::Value {
        let all = |nodes: &[Node]| toml::Value::Array(nodes.iter().map(Self::to_toml_value).collect());
        let (key, value) = match self {
            Self::Leaf { kind, name, .. } => (kind.key(), toml::Value::String(name.clone())),
            Self::Series(nodes) => (SERIES, all(nodes)),
            Self::Parallel(nodes) => (PARALLEL, all(nodes)),
        };
        toml::Value::Table(toml::Table::from_iter([(key.to_string(), value)]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rheology::{BaseLaw, RetardationSpectrum, TimeWindow};

    fn read(text: &str) -> Result<&'static Network> {
        let document = TomlInput::parse(Path::new("model.toml"), text)?;
        let base = document.root().required_table("base")?;
        Network::from_toml(&base.required_table("network")?)
    }

    /// Checks that siblings of equal structure are interchangeable, even with another element between them or with their elements
    /// in another order. An element with a repeated name is not.
    #[test]
    fn parts_of_one_structure_are_interchangeable() {
        let alike = |text: &str| -> Vec<Vec<Vec<&str>>> {
            let network = Network::from_text(Path::new("law.toml"), text).unwrap();
            let names = |part: &Vec<ParameterSpec>| part.iter().map(|spec| spec.name).collect();
            network
                .interchangeable_parts()
                .iter()
                .map(|InterchangeableParts(parts)| parts.iter().map(names).collect())
                .collect()
        };
        assert_eq!(
            alike("parallel = [{ springpot = \"a\" }, { spring = \"e\" }, { springpot = \"b\" }]"),
            [[["a_modulus_pa", "a_order"], ["b_modulus_pa", "b_order"]]]
        );
        assert_eq!(
            alike(
                "series = [{ parallel = [{ spring = \"e\" }, { dashpot = \"c\" }] }, { parallel = [{ dashpot = \"d\" }, { spring = \"f\" }] }, { dashpot = \"g\" }]"
            ),
            [[["c_viscosity_pa_s", "e_modulus_pa"], ["d_viscosity_pa_s", "f_modulus_pa"]]]
        );
        let none: [Vec<Vec<&str>>; 0] = [];
        assert_eq!(alike("series = [{ spring = \"e\" }, { dashpot = \"c\" }]"), none);
        assert_eq!(alike("series = [{ dashpot = \"c\" }, { dashpot = \"c\" }]"), none);
    }

    const ZENER: &str = "[base.network]\nseries = [\n  { parallel = [{ spring = \"e\" }, { springpot = \"p\" }] },\n  { dashpot = \"c\" },\n]\n";

    #[test]
    fn a_network_is_a_base_law() {
        let law = BaseLaw::Network(read(ZENER).unwrap());
        let names: Vec<&str> = law.parameters().iter().map(|spec| spec.name).collect();
        assert_eq!(names, ["e_modulus_pa", "p_modulus_pa", "p_order", "c_viscosity_pa_s"]);
        let elements = law.elements(&[3.5, 1.4, 1.0, 47.0].map(Dual::constant));
        let window = TimeWindow { shortest_s: 0.05, longest_s: 40.0 };
        let found = RetardationSpectrum::of_law(&elements, window).unwrap();
        let lethersich = BaseLaw::Lethersich.elements(&[3.5, 1.4, 47.0].map(Dual::constant));
        // A springpot of order 1 is a dashpot with the viscosity G (1 s).
        assert_eq!(found, RetardationSpectrum::of_law(&lethersich, window).unwrap());
        for spec in law.parameters() {
            let (prior, _) = law.default_prior(spec.name, &|_| f64::NAN).unwrap();
            let (lower, upper) = prior.support();
            assert!(spec.support.contains(lower) && upper <= spec.support.upper, "{}", spec.name);
        }
    }

    #[test]
    fn a_network_survives_being_written_and_is_kept_once() {
        let network = read(ZENER).unwrap();
        let base = toml::Table::from_iter([("network".to_string(), network.to_toml_value())]);
        let root = toml::Table::from_iter([("base".to_string(), toml::Value::Table(base))]);
        let again = read(&toml::to_string(&root).unwrap()).unwrap();
        assert!(std::ptr::eq(network, again));
        let inline = read("base = { network = { parallel = [{ spring = \"e\" }, { dashpot = \"c\" }] } }").unwrap();
        assert!(!std::ptr::eq(network, inline));
    }

    #[test]
    fn one_name_twice_is_one_element() {
        let text =
            "[base.network]\nseries = [{ spring = \"e\" }, { parallel = [{ spring = \"e\" }, { dashpot = \"c\" }] }]";
        let network = read(text).unwrap();
        assert_eq!(network.parameters().len(), 2);
        let spring = Element::Spring { modulus_pa: 2.0.into() };
        let elements = network.elements(&[2.0.into(), 5.0.into()]);
        assert_eq!(elements, [spring, Element::kelvin_voigt(2.0.into(), 5.0.into())]);
    }

    #[test]
    fn a_network_has_a_largest_size() {
        let of = |n: usize| {
            let bodies: Vec<String> = (0..n).map(|k| format!("{{ springpot = \"p{k}\" }}")).collect();
            read(&format!("[base.network]\nseries = [{}]\n", bodies.join(", ")))
        };
        assert_eq!(of(MAX_ELEMENTS).unwrap().parameters().len(), 2 * MAX_ELEMENTS);
        for n in [MAX_ELEMENTS + 1, 1_000] {
            let message = of(n).unwrap_err().to_string();
            assert!(message.contains("line 2") && message.contains("at most 64 elements"), "{message}");
        }
    }

    #[test]
    fn mistakes_are_named_with_their_line_and_remedy() {
        let cases = [
            ("[base.network]\nseries = []\n", "line 2, `base.network.series`", "dashpot = \"flow\""),
            ("[base.network]\nsprin = \"e\"\n", "line 2, `base.network.sprin`", "did you mean `spring`"),
            (
                "[base.network]\nseries = [\n { spring = \"e\" },\n { dashpot = 3 },\n]\n",
                "line 4, `base.network.series[2].dashpot`",
                "= \"…\"",
            ),
            ("[base.network]\nseries = [\n { spring = \"e\" },\n { dashpot = \"e\" },\n]\n", "line 4", "own name"),
            ("[base.network]\nseries = [\n { spring = \"E 1\" },\n]\n", "line 3", "lower-case"),
            ("[base.network]\nseries = [\n { },\n]\n", "line 3, `base.network.series[1]`", "give one of spring"),
            ("[base.network]\nspring = \"e\"\ndashpot = \"c\"\n", "line 1, `base.network`", "`series` or `parallel`"),
            ("[base.network]\nparallel = \"e\"\n", "line 2", "parallel = [{ spring"),
            ("[base.network]\nparallel = [\"e\"]\n", "line 2", "parallel = [{ spring"),
        ];
        for (text, place, remedy) in cases {
            let message = read(text).unwrap_err().to_string();
            assert!(message.contains(place) && message.contains(remedy), "{text}\n{message}");
        }
    }
}
