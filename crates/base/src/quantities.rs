//! Words and units of the two quantities of a record. All sentences, keys and figures of the program are written for a commanded force in µN and a measured position in
//! µm. For other records, this module exchanges the words and units.

use serde_json::{Map, Value};
use std::borrow::Cow;

crate::named_enum! {
    /// Quantities of a record that is not a commanded force in µN with a measured position in µm. Numbers stay the same: the reader scales a record to these units.
    pub enum Quantities {
        /// Commanded position in µm, measured force in µN.
        Relaxation = "relaxation",
        /// Commanded stress in Pa, measured strain in %.
        StressCreep = "stress-creep",
        /// Commanded strain in %, measured stress in Pa.
        StressRelaxation = "stress-relaxation",
    }
    /// Name in the header of documents.
    pub fn name
}

/// Words that are exchanged: a word of the sentences, and the words for the three kinds of quantities, in the order of [`Quantities::ALL`].
const WORDS: [(&str, [&str; 3]); 12] = [
    ("position", ["force", "strain", "stress"]),
    ("positions", ["forces", "strains", "stresses"]),
    ("Position", ["Force", "Strain", "Stress"]),
    ("Positions", ["Forces", "Strains", "Stresses"]),
    ("force", ["position", "stress", "strain"]),
    ("forces", ["positions", "stresses", "strains"]),
    ("Force", ["Position", "Stress", "Strain"]),
    ("Forces", ["Positions", "Stresses", "Strains"]),
    ("µm", ["µN", "%", "Pa"]),
    ("um", ["uN", "%", "Pa"]),
    ("µN", ["µm", "Pa", "%"]),
    ("tracker", ["sensor", "instrument", "instrument"]),
];

/// Units of parameters that are exchanged, as in [`WORDS`]. A record of stress and strain has 1 µN for 1 Pa and 1 µm for 1 %.
const UNITS: [(&str, [&str; 3]); 2] = [("m", ["N", "10⁶ %", "MPa"]), ("N", ["m", "MPa", "10⁶ %"])];

impl Quantities {
    /// Quantities of a record; `None` for a commanded force and a measured position.
    pub fn of(is_position_commanded: bool, is_stress_strain: bool) -> Option<Self> {
        match (is_position_commanded, is_stress_strain) {
            (false, false) => None,
            (false, true) => Some(Self::StressCreep),
            (true, false) => Some(Self::Relaxation),
            (true, true) => Some(Self::StressRelaxation),
        }
    }

    /// Quantities with this name; `None` if there are none.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|quantities| quantities.name() == name)
    }

    /// Key of the measured quantity, for a key of the position; of the commanded one, for a key of the force.
    pub fn key(self, key: &str) -> String {
        match (key.strip_suffix("_um"), key.strip_suffix("_un")) {
            (Some(stem), _) => format!("{stem}{}", self.key_ending()),
            (_, Some(stem)) => format!("{stem}{}", self.command_ending()),
            _ => key.to_string(),
        }
    }

    /// Exchanges words and units in a text. Names in backticks, and words that are parts of names with hyphens or underscores, stay as they are.
    pub fn translate(self, text: &str) -> Cow<'_, str> {
        if !WORDS.iter().chain(&UNITS).any(|(word, _)| text.contains(word)) {
            return Cow::Borrowed(text);
        }
        let is_of_name = |c: char| c.is_alphanumeric() || matches!(c, '-' | '_' | 'µ');
        let mut translated = String::with_capacity(text.len());
        let (mut is_code, mut rest) = (false, text);
        while let Some(first) = rest.chars().next() {
            let end = rest.find(|c| !is_of_name(c)).unwrap_or(rest.len());
            if end == 0 {
                is_code ^= first == '`';
                translated.push(first);
                rest = &rest[first.len_utf8()..];
                continue;
            }
            let (word, after) = rest.split_at(end);
            // Units of parameters stand in brackets.
            let is_unit = translated.ends_with('(') && (after.starts_with(')') || after.starts_with("/s)"));
            if let Some((_, others)) = UNITS.iter().find(|(own, _)| is_unit && !is_code && *own == word) {
                translated.push_str(others[self as usize]);
                rest = after;
                continue;
            }
            let other = WORDS.iter().find(|(own, _)| !is_code && *own == word);
            translated.push_str(other.map_or(word, |(_, others)| others[self as usize]));
            rest = after;
        }
        Cow::Owned(translated)
    }

    /// Exchanges words and units in the text of a page, and leaves tags, attributes, style sheets and drawings as they are. Drawings are translated as they are made.
    pub fn translate_page(self, page: &str) -> String {
        let mut translated = String::with_capacity(page.len());
        let mut rest = page;
        while let Some(start) = rest.find("<svg") {
            let end = start + drawing_length(&rest[start..]);
            translated.push_str(&self.translate_drawing(&rest[..start]));
            translated.push_str(&rest[start..end]);
            rest = &rest[end..];
        }
        translated.push_str(&self.translate_drawing(rest));
        translated
    }

    /// Exchanges words and units in the text of a drawing, and leaves tags, attributes and style sheets as they are.
    pub fn translate_drawing(self, markup: &str) -> String {
        let mut translated = String::with_capacity(markup.len());
        let (mut rest, mut is_style) = (markup, false);
        while let Some(start) = rest.find('<') {
            let (text, from) = rest.split_at(start);
            if is_style {
                translated.push_str(text)
            } else {
                translated.push_str(&self.translate(text))
            }
            let end = from.find('>').map_or(from.len(), |end| end + 1);
            let (tag, after) = from.split_at(end);
            is_style = tag.starts_with("<style") || tag.starts_with("<script") || is_style && !tag.starts_with("</");
            translated.push_str(tag);
            rest = after;
        }
        translated.push_str(&self.translate(rest));
        translated
    }

    /// Ending of the keys of commanded quantities, in place of `_un`.
    fn command_ending(self) -> &'static str {
        match self {
            Self::Relaxation => "_um",
            Self::StressCreep => "_pa",
            Self::StressRelaxation => "_percent",
        }
    }

    /// Ending of the keys of measured quantities in documents and settings, in place of `_um`.
    fn key_ending(self) -> &'static str {
        match self {
            Self::Relaxation => "_un",
            Self::StressCreep => "_percent",
            Self::StressRelaxation => "_pa",
        }
    }
}

/// Length of the drawing that a text begins with, including drawings inside it.
fn drawing_length(markup: &str) -> usize {
    let (mut depth, mut place) = (0, 0);
    while let Some(found) = markup[place..].find("svg") {
        let at = place + found;
        place = at + "svg".len();
        if markup[..at].ends_with("</") {
            depth -= 1;
            if depth == 0 {
                return markup[place..].find('>').map_or(markup.len(), |end| place + end + 1);
            }
        } else if markup[..at].ends_with('<') {
            depth += 1;
        }
    }
    markup.len()
}

/// Whether a key of a document is that of a position or a force.
fn is_key(key: &str) -> bool {
    key.ends_with("_um") || key.ends_with("_un")
}

impl Quantities {
    /// Translates the sentences of a document and the keys of its quantities. A key of the position stays with the value null beside the key of the measured
    /// quantity, so that readers of one key find it in every document.
    pub fn translate_document(self, document: Value) -> Value {
        self.translated(document, true)
    }

    /// Translates the sentences of a document only.
    pub fn translate_sentences(self, document: Value) -> Value {
        self.translated(document, false)
    }

    fn translated(self, document: Value, with_keys: bool) -> Value {
        match document {
            Value::String(text) => Value::String(self.translate(&text).into_owned()),
            Value::Array(values) => values.into_iter().map(|value| self.translated(value, with_keys)).collect(),
            Value::Object(object) => {
                let mut translated = Map::new();
                for (key, value) in object {
                    let value = self.translated(value, with_keys);
                    if with_keys && is_key(&key) {
                        translated.insert(self.key(&key), value);
                        if key.ends_with("_um") && !translated.contains_key(&key) {
                            translated.insert(key, Value::Null);
                        }
                    } else {
                        translated.insert(key, value);
                    }
                }
                Value::Object(translated)
            }
            other => other,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_and_units_are_exchanged_and_names_stay() {
        let text = "Position 4.79 to 4.21 µm (tracker), force 4.6 µN: `force-bias` and position-offset, x_um, in µm·s";
        let expected =
            "Force 4.79 to 4.21 µN (sensor), position 4.6 µm: `force-bias` and position-offset, x_um, in µN·s";
        assert_eq!(Quantities::Relaxation.translate(text), expected);
        assert_eq!(Quantities::StressCreep.translate("positions in µm, forces in µN"), "strains in %, stresses in Pa");
        // An offset of 1 µm stands for one of 1 %, and 1 N for 1 MPa.
        let units = "offset b (m), drift v (m/s), bias (N), modulus E (Pa), 3 m, `x (m)`";
        let expected = "offset b (10⁶ %), drift v (10⁶ %/s), bias (MPa), modulus E (Pa), 3 m, `x (m)`";
        assert_eq!(Quantities::StressCreep.translate(units), expected);
        assert_eq!(Quantities::Relaxation.translate("offset b (m)"), "offset b (N)");
        assert_eq!(Quantities::StressRelaxation.translate("`position` (µm)"), "`position` (Pa)");
        assert_eq!(Quantities::Relaxation.translate("nothing"), "nothing");
    }

    #[test]
    fn tags_and_styles_stay() {
        let drawing = "<svg a=\"svg\">force <svg>force</svg> force</svg>";
        let markup =
            format!("<style>a {{ position: sticky; }}</style><p class=\"position\">position (µm)</p>{drawing} force");
        let expected =
            format!("<style>a {{ position: sticky; }}</style><p class=\"position\">force (µN)</p>{drawing} position");
        assert_eq!(Quantities::Relaxation.translate_page(&markup), expected);
    }

    #[test]
    fn keys_and_sentences_of_documents_are_translated() {
        let document = serde_json::json!({
            "rmse_heldout_um": 3.5, "missing_um": null, "largest_un": 7.0, "name": "tracking_drift.rate_um_per_s",
            "list": [{ "noise_um": [1.0, 2.0], "sentence": "3.5 µm at a position" }]
        });
        for quantities in Quantities::ALL {
            let translated = quantities.translate_document(document.clone());
            assert_eq!(translated["rmse_heldout_um"], Value::Null);
            assert_eq!(translated[quantities.key("rmse_heldout_um")], 3.5);
            assert_eq!(translated[quantities.key("largest_un")], 7.0);
            assert_eq!(translated["name"], document["name"]);
        }
    }

    #[test]
    fn names_lead_back() {
        for quantities in Quantities::ALL {
            assert_eq!(Quantities::named(quantities.name()), Some(quantities));
        }
    }
}
