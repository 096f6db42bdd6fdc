//! Networks that users can name, besides the laws with a closed form.

use std::path::Path;

use super::Network;

/// Network with a name.
struct NamedNetwork {
    /// Name in `model.toml` and on the command line.
    name: &'static str,
    /// Network as the table that [`Network::from_text`] reads.
    text: &'static str,
}

const ALL: [NamedNetwork; 8] = [
    NamedNetwork { name: "maxwell", text: "series = [{ spring = \"gel\" }, { dashpot = \"flow\" }]" },
    NamedNetwork { name: "kelvin-voigt", text: "parallel = [{ spring = \"gel\" }, { dashpot = \"solvent\" }]" },
    NamedNetwork {
        name: "standard-linear-solid",
        text: "parallel = [{ spring = \"gel\" }, { series = [{ spring = \"relaxing\" }, { dashpot = \"flow\" }] }]",
    },
    NamedNetwork { name: "springpot", text: "springpot = \"gel\"" },
    NamedNetwork {
        name: "fractional-kelvin-voigt",
        text: "parallel = [{ spring = \"gel\" }, { springpot = \"mesh\" }]",
    },
    NamedNetwork { name: "fractional-maxwell", text: "series = [{ springpot = \"gel\" }, { springpot = \"mesh\" }]" },
    NamedNetwork { name: "spring-springpot", text: "series = [{ spring = \"gel\" }, { springpot = \"mesh\" }]" },
    NamedNetwork {
        name: "two-mode-maxwell",
        text: "parallel = [{ series = [{ spring = \"first\" }, { dashpot = \"first_flow\" }] }, { series = [{ spring = \"second\" }, { dashpot = \"second_flow\" }] }]",
    },
];

impl Network {
    /// Names of all networks with a name.
    pub fn names() -> impl Iterator<Item = &'static str> {
        ALL.iter().map(|named| named.name)
    }

    /// Network with this name; `None` if there is none.
    pub fn named(name: &str) -> Option<&'static Self> {
        let named = ALL.iter().find(|named| named.name == name)?;
        Self::from_text(Path::new(named.name), named.text).ok()
    }

    /// Name of this network; `None` if it has none.
    pub fn name(&self) -> Option<&'static str> {
        Self::names().find(|name| Self::named(name).is_some_and(|network| std::ptr::eq(network, self)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_lead_to_networks_and_back() {
        for name in Network::names() {
            assert_eq!(Network::named(name).and_then(Network::name), Some(name));
        }
        let other =
            Network::from_text(Path::new("own.toml"), "series = [{ spring = \"own\" }, { dashpot = \"flow\" }]");
        assert_eq!(other.unwrap().name(), None);
    }
}
