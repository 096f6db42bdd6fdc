//! Valid files with other values, written in other ways that their grammar allows: order, white space, units, spellings of numbers and texts, omitted keys.
//!
//! Damaged files (the parent module) are nearly always refused, and so test only the code before a reader's first check. Valid variants test the code after it.

use serde_json::{Map, Value};

use super::Dice;

/// Grammar of a kind of file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Grammar {
    Toml,
    /// JSON objects, one per line.
    JsonLines,
    /// A word, a space, and a JSON object.
    Request,
    /// The program's own CSV.
    OwnTable,
    /// A table as written by instruments and spreadsheets.
    AnyTable,
    /// Gmsh 4.1 in ASCII.
    Mesh,
    /// Shell command lines.
    Commands,
}

/// Another file of the same grammar.
pub fn variant(grammar: Grammar, sample: &[u8], dice: &mut Dice) -> Vec<u8> {
    let text = std::str::from_utf8(sample).expect("samples of grammars are text");
    let text = match grammar {
        Grammar::Toml => {
            let document: Map<String, Value> = toml::from_str(text).expect("the sample is TOML");
            toml_table(&document, "", dice)
        }
        Grammar::JsonLines => text.lines().map(|line| json(&parsed(line), "", false, dice) + "\n").collect(),
        Grammar::Request => {
            let (word, body) = text.split_once(' ').expect("an endpoint and a body");
            let words = ["Evaluate", "Gradient", "ApplyJacobian", "InputSizes", "OutputSizes", "ModelInfo"];
            let word = if dice.one_in(8) { words[dice.below(words.len())] } else { word };
            format!("{word} {}", json(&parsed(body), "", true, dice))
        }
        Grammar::OwnTable => table(text, true, dice),
        Grammar::AnyTable => table(text, false, dice),
        Grammar::Mesh => mesh(text, dice),
        Grammar::Commands => commands(text, dice),
    };
    // A file's line ends are all of one system.
    if dice.one_in(4) { text.replace('\n', "\r\n").into_bytes() } else { text.into_bytes() }
}

fn parsed(text: &str) -> Value {
    serde_json::from_str(text).expect("the sample is JSON")
}

impl Dice {
    fn one_in(&mut self, n: usize) -> bool {
        self.below(n) == 0
    }

    /// A number between 0 and 1.
    fn unit(&mut self) -> f64 {
        self.below(1 << 30) as f64 / f64::from(1 << 30)
    }

    fn pick<'a>(&mut self, list: &[&'a str]) -> &'a str {
        list[self.below(list.len())]
    }

    fn shuffle<T>(&mut self, list: &mut [T]) {
        (1..list.len()).for_each(|last| list.swap(last, self.below(last + 1)));
    }

    fn space(&mut self) -> &'static str {
        self.pick(&["", "", " ", " ", "  ", "\t"])
    }
}

/// A number: unchanged, slightly changed, within a decade, or an unusual one.
fn value(number: f64, dice: &mut Dice) -> f64 {
    match dice.below(100) {
        0..=69 => number,
        70..=89 => number * (0.98 + 0.04 * dice.unit()),
        90..=97 => number * 10_f64.powf(2.0 * dice.unit() - 1.0),
        98 => -number,
        _ => [0.0, 1.0, -1.0, 1e-300, 5e-324, 1e15, 1e100, f64::MAX, 0.5][dice.below(9)],
    }
}

fn whole(number: i64, dice: &mut Dice) -> i64 {
    match dice.below(40) {
        0 => number.saturating_add(1),
        1 => number.saturating_mul(2),
        2 => [0, -1, i64::MAX, 1 << 32][dice.below(4)],
        _ => number,
    }
}

/// A spelling that every grammar here accepts.
fn spelt(number: f64, dice: &mut Dice) -> String {
    match dice.below(4) {
        0 => format!("{number:e}").replace('e', if number == 0.0 { "e" } else { ["e", "E"][dice.below(2)] }),
        1 if (1e-3..1e6).contains(&number.abs()) => format!("{number:.9}"),
        // The usual notation with a point, because TOML distinguishes integers.
        _ => format!("{number:?}"),
    }
}

/// Keys with free texts.
const FREE_TEXTS: [&str; 5] = ["id", "species", "region", "source", "summary"];

/// Formulas that are equal or similar to the sample's.
const FORMULAS: [&str; 8] = [
    "exp(rate*path)",
    "1 + rate * path",
    "(((1+path*rate)))",
    "exp(rate * path) ^ 1.5",
    "1/(1 + rate*path)",
    "-(-exp(--rate * path))",
    "exp(rate * path * 1e0 / 2.) - 0*sqrt(path + 1)",
    "1 + tanh(rate) * path ^ 2",
];

fn free_text(key: &str, text: &str, dice: &mut Dice) -> String {
    if key == "factor" && dice.one_in(2) {
        return dice.pick(&FORMULAS).into();
    }
    if !FREE_TEXTS.contains(&key) || dice.one_in(2) {
        return text.into();
    }
    text.to_string()
        + dice.pick(&["é", " 2", "µm", "𝛂", "\"q\"", "'", "\\", "#", " = [x]", "{}", "\u{202e}", "\t", "-"])
}

/// Sections and keys in any order. `path` is the table's path with a trailing point.
fn toml_table(table: &Map<String, Value>, path: &str, dice: &mut Dice) -> String {
    let mut keys: Vec<&String> = table.keys().filter(|_| !dice.one_in(60)).collect();
    dice.shuffle(&mut keys);
    let (mut text, mut sections) = (String::new(), String::new());
    for key in keys {
        let name = if dice.one_in(6) { format!("\"{key}\"") } else { key.clone() };
        match &table[key] {
            Value::Object(inner) if !dice.one_in(4) => {
                let place = format!("{path}{name}");
                let head = format!("{}[{}{place}{}]", dice.space(), dice.space(), dice.space());
                sections += &format!("{head}{}{}", aside(dice), toml_table(inner, &format!("{place}."), dice));
            }
            other => {
                let between = [dice.space(), dice.space(), dice.space()];
                let [before, left, right] = between;
                text += &format!("{before}{name}{left}={right}{}{}", toml_value(other, key, dice), aside(dice));
            }
        }
    }
    if dice.one_in(80) {
        text += "something_else = 1\n";
    }
    text + &sections
}

/// End of a line, sometimes with a comment.
fn aside(dice: &mut Dice) -> String {
    let comment = dice.pick(&["", "", "", " # µ", "\t#", "  "]);
    let lines = dice.pick(&["\n", "\n", "\n\n", "\n# [robot] = \"\n"]);
    format!("{comment}{lines}")
}

fn toml_value(of: &Value, key: &str, dice: &mut Dice) -> String {
    match of {
        Value::Number(number) if number.is_i64() => {
            let number = whole(number.as_i64().unwrap_or(0), dice);
            match dice.below(4) {
                0 => format!("{number:+}"),
                1 if number > 999 => format!("{}_{:03}", number / 1000, number % 1000),
                _ => number.to_string(),
            }
        }
        Value::Number(number) => spelt(value(number.as_f64().unwrap_or(0.0), dice), dice),
        Value::String(text) => {
            let text = free_text(key, text, dice);
            let is_literal = !text.contains(['\'', '\n', '\t']) && dice.one_in(3);
            if is_literal { format!("'{text}'") } else { quoted(&text, dice) }
        }
        Value::Array(list) => {
            let items: Vec<String> = list.iter().map(|item| toml_value(item, key, dice)).collect();
            let between = dice.pick(&[", ", ",", ",\n  ", " , "]);
            let last = if items.is_empty() { "" } else { dice.pick(&["", "", ","]) };
            format!("[{}{}{last}]", dice.space(), items.join(between))
        }
        Value::Object(table) => {
            let mut keys: Vec<&String> = table.keys().collect();
            dice.shuffle(&mut keys);
            let pairs: Vec<String> =
                keys.into_iter().map(|key| format!("{key} = {}", toml_value(&table[key], key, dice))).collect();
            format!("{{ {} }}", pairs.join(", "))
        }
        other => other.to_string(),
    }
}

/// A text between quotation marks, for JSON and TOML. Letters may be escaped as numbers.
fn quoted(text: &str, dice: &mut Dice) -> String {
    let written = serde_json::to_string(text).expect("a text");
    match text.chars().next().filter(|first| first.is_ascii_alphanumeric() && dice.one_in(6)) {
        Some(first) => format!("\"\\u{:04x}{}", u32::from(first), &written[2..]),
        None => written,
    }
}

fn json(of: &Value, key: &str, with_lines: bool, dice: &mut Dice) -> String {
    let space = |dice: &mut Dice| if with_lines { dice.pick(&["", "", " ", "\n", "\t"]) } else { dice.space() };
    match of {
        Value::Number(number) if number.is_i64() => whole(number.as_i64().unwrap_or(0), dice).to_string(),
        Value::Number(number) => spelt(value(number.as_f64().unwrap_or(0.0), dice), dice),
        Value::String(text) => quoted(&free_text(key, text, dice), dice),
        Value::Array(list) => {
            let items: Vec<String> =
                list.iter().map(|item| space(dice).to_string() + &json(item, key, with_lines, dice)).collect();
            format!("[{}{}]", items.join(","), space(dice))
        }
        Value::Object(table) => {
            let mut keys: Vec<&String> = table.keys().filter(|_| !dice.one_in(60)).collect();
            dice.shuffle(&mut keys);
            let mut pairs = Vec::new();
            for key in keys {
                let (name, inner) = (quoted(key, dice), json(&table[key], key, with_lines, dice));
                pairs.push(format!("{}{name}{}:{}{inner}", space(dice), space(dice), space(dice)));
            }
            if dice.one_in(20) {
                pairs.push("\"something else\": [null, {}]".into());
            }
            format!("{{{}{}}}", pairs.join(","), space(dice))
        }
        other => other.to_string(),
    }
}

/// Units of time, force and position, with their sizes in the sample's units: s, µN and µm.
const UNITS: [&[(&str, f64)]; 3] = [
    &[("s", 1.0), ("ms", 1e-3)],
    &[("uN", 1.0), ("N", 1e6), ("mN", 1e3), ("nN", 1e-3), ("pN", 1e-6)],
    &[("um", 1.0), ("m", 1e6), ("mm", 1e3), ("nm", 1e-3)],
];
const NAMES: [[&str; 3]; 3] = [["time", "force", "position"], ["Time", "Force", "Position"], ["t", "F", "x"]];

/// A table of time (s), force (µN), position (µm) and cycle.
fn table(text: &str, is_own: bool, dice: &mut Dice) -> String {
    let number = |cell: &str| cell.parse::<f64>().expect("the sample has numbers");
    let rows: Vec<Vec<f64>> = text.lines().skip(1).map(|line| line.split(',').map(number).collect()).collect();
    let units: [(&str, f64); 3] = std::array::from_fn(|k| UNITS[k][dice.below(UNITS[k].len())]);
    let scales: [f64; 3] = std::array::from_fn(|_| if dice.one_in(3) { 0.5 + dice.unit() } else { 1.0 });
    let delimiter = if is_own { "," } else { dice.pick(&[",", ";", "\t"]) };
    let has_comma = delimiter != "," && dice.one_in(3);
    let names = NAMES[if is_own { 0 } else { dice.below(NAMES.len()) }];
    let ends = if is_own { ["_", ""] } else { [["_", ""], [" [", "]"], [" (", ")"]][dice.below(3)] };
    let mut columns: Vec<usize> = if dice.one_in(3) { vec![0, 1, 2] } else { vec![0, 1, 2, 3] };
    dice.shuffle(&mut columns);
    let pad = |cell: String, dice: &mut Dice| if dice.one_in(8) { format!(" {cell} ") } else { cell };
    let head = |k: usize| match names.get(k) {
        Some(name) => format!("{name}{}{}{}", ends[0], units[k].0, ends[1]),
        None => "cycle".into(),
    };
    let mut out = String::new();
    if !is_own && dice.one_in(3) {
        out += dice.pick(&["Recorded by hand\n\n", "# Version 3.1\n", "Sample;gel\n", "Rate: 10 Hz\nOperator: é\n"]);
    }
    if dice.one_in(10) {
        out.insert(0, '\u{feff}');
    }
    let names: Vec<String> = columns.iter().map(|k| pad(head(*k), dice)).collect();
    out += &(names.join(delimiter) + "\n");
    let is_jittered = dice.one_in(3);
    for row in &rows {
        let mut cells = Vec::new();
        for &k in &columns {
            let cell = match k {
                3 => format!("{}", row[3]),
                2 if dice.one_in(40) => String::new(),
                _ => {
                    let jitter = if is_jittered && k == 2 { 0.01 * dice.unit() } else { 0.0 };
                    let exact = (row[k] * scales[k] + jitter) / units[k].1;
                    // One value in several thousand is unusual.
                    spelt(if dice.one_in(4_000) { value(exact, dice) * 1e6 } else { exact }, dice)
                }
            };
            cells.push(pad(if has_comma { cell.replace('.', ",") } else { cell }, dice));
        }
        out += &(cells.join(delimiter) + "\n");
    }
    if dice.one_in(4) {
        out.pop();
    }
    out
}

/// Changes the order of nodes in a block, the coordinates' unit or rounding, white space, and sections that readers skip.
fn mesh(text: &str, dice: &mut Dice) -> String {
    let scale = if dice.one_in(2) { 0.5 + 1.5 * dice.unit() } else { 1.0 };
    let (is_spelt, is_spaced) = (dice.one_in(2), dice.one_in(2));
    let hard = dice.one_in(6).then(|| dice.below(600));
    let mut lines = text.lines();
    let (mut out, mut section, mut n_coordinates) = (String::new(), "", 0);
    let blank = |line: &str, dice: &mut Dice| match is_spaced && dice.one_in(10) {
        true => format!("{}{}{}\n", dice.space(), line.replace(' ', dice.pick(&[" ", "  ", "\t"])), dice.space()),
        false => format!("{line}\n"),
    };
    while let Some(line) = lines.next() {
        if line.starts_with('$') {
            section = line;
            if !line.starts_with("$End") && !line.starts_with("$MeshFormat") && dice.one_in(4) {
                out += "$Comments\nof no account: 1 2 3 $\n$EndComments\n";
            }
            out += &format!("{line}\n");
            continue;
        }
        let words: Vec<&str> = line.split_whitespace().collect();
        out += &blank(line, dice);
        // A block of nodes: its head, the numbers of all nodes, then all coordinates.
        let n_nodes = match (section, words.len()) {
            ("$Nodes", 4) if !out.ends_with(&format!("$Nodes\n{line}\n")) => words[3].parse::<usize>().unwrap_or(0),
            _ => 0,
        };
        let mut part = |_| lines.next().expect("the sample is whole").to_string();
        let (tags, places): (Vec<String>, Vec<String>) =
            ((0..n_nodes).map(&mut part).collect(), (0..n_nodes).map(&mut part).collect());
        let mut nodes: Vec<(String, String)> = tags.into_iter().zip(places).collect();
        if dice.one_in(2) {
            dice.shuffle(&mut nodes);
        }
        for (tag, _) in &nodes {
            out += &blank(tag, dice);
        }
        for (_, place) in &nodes {
            let mut cells = Vec::new();
            for cell in place.split_whitespace() {
                let mut number = scale * cell.parse::<f64>().expect("a coordinate");
                if hard == Some(n_coordinates) {
                    number = value(10.0 * number, dice);
                }
                n_coordinates += 1;
                cells.push(if is_spelt { spelt(number, dice) } else { format!("{number:?}") });
            }
            out += &blank(&cells.join(" "), dice);
        }
    }
    out
}

/// Options in another order, words between quotation marks or with a backslash, comments and empty lines.
fn commands(text: &str, dice: &mut Dice) -> String {
    let mut out = String::new();
    for line in text.lines() {
        let mut words = line.split(' ');
        let mut groups: Vec<Vec<String>> = vec![words.by_ref().take(2).map(String::from).collect()];
        for word in words {
            match word.starts_with("--") {
                true => groups.push(vec![word.into()]),
                false => groups.last_mut().expect("a command").push(word.into()),
            }
        }
        dice.shuffle(&mut groups[1..]);
        if dice.one_in(2) {
            groups.insert(0, vec!["vitreo-uq".into()]);
        }
        let mut written = Vec::new();
        for word in groups.concat() {
            written.push(match (word.parse::<f64>(), dice.below(6)) {
                (Ok(number), _) => format!("{}", value(number, dice)),
                (_, 0) => format!("'{word}'"),
                (_, 1) => format!("\"{word}\""),
                (_, 2) if word.is_ascii() => format!("\\{word}"),
                _ => word,
            });
        }
        out += dice.pick(&["", "", "# a comment, 'with a mark\n", "\n", "   \t\n"]);
        let end = dice.pick(&["", "", "  ", " # the rest"]);
        out += &format!("{}{}{end}\n", dice.space(), written.join(dice.pick(&[" ", "  ", "\t"])));
    }
    // A quotation mark that is not closed.
    if dice.one_in(20) { out + "fit 'gel --out {out}\n" } else { out }
}
