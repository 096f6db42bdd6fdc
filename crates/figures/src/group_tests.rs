//! Tests the figures of groups. They are legible for two to nine groups and for one to two hundred specimens. They refuse empty data, and the position of every
//! mark corresponds to its number.

use super::contrasts::{ContrastCell, ContrastMatrix, ContrastPanel, contrast_matrix};
use super::creep_bands::{CreepBands, CreepGroup, creep_bands};
use super::forest::{Forest, ForestPanel, ForestReference, ForestRow, SpecimenMark, forest};
use super::layout_tests::{LONG, assert_legible};
use super::palette::{Colour, series};
use super::svg::Svg;

const NAMES: [&str; 9] = [
    "porcine",
    "bovine",
    LONG,
    "human, basal",
    "rabbit",
    "extraordinarily-long-word",
    "sheep",
    "goat",
    "human, central",
];
const LABELS: [&str; 4] = ["E (Pa)", "c₁ (Pa·s)", "interface-slip: slip compliance (m/(Pa·s))", "α (–)"];

/// Deterministic numbers between −1 and 1 that look random.
fn wobble(i: usize) -> f64 {
    2.0 * (0.5 + i as f64 * 0.618_033_988_749_895).fract() - 1.0
}

/// Names of `n` specimens.
fn specimen_names(n: usize) -> Vec<String> {
    (0..n).map(|i| if i == 1 { LONG.to_owned() } else { format!("specimen {}", i + 1) }).collect()
}

fn row<'a>(group: usize, centre: f64, spread: f64, names: &'a [String]) -> ForestRow<'a> {
    let specimen = |(i, name): (usize, &'a String)| {
        let shift = (spread * wobble(i + 3 * group)).exp();
        SpecimenMark {
            name,
            unpooled: [0.5, 1.0, 2.5].map(|factor| centre * shift * factor),
            pooled: [0.7, 1.0, 1.6].map(|factor| centre * shift.sqrt() * factor),
            is_outlying: i % 7 == 1,
        }
    };
    ForestRow {
        group: NAMES[group],
        colour: series(group),
        n_specimens: names.len(),
        typical: [0.9, 1.0, 1.1].map(|factor| centre * factor),
        new_specimen: [0.5 * centre, 2.0 * centre],
        specimens: names.iter().enumerate().map(specimen).collect(),
    }
}

fn panels<'a>(n_panels: usize, sizes: &[usize], names: &'a [String]) -> Vec<ForestPanel<'a>> {
    let panel = |p: usize| {
        let centre = |group: usize| [3.5, 1.4e5, 2e-7, 0.4][p] * 1.3f64.powi(group as i32);
        let rows = sizes.iter().enumerate().map(|(group, n)| row(group, centre(group), 0.4, &names[..*n])).collect();
        let reference = |(k, label)| ForestReference { label, value: centre(0) * [0.9, 1.0, 1.02, 1e6, 1e-6, 1.3][k] };
        let labels = ["Lee 1992", "Sharif-Kashani 2011", LONG, "too much", "too little", "Tram 2018"];
        ForestPanel {
            label: LABELS[p].into(),
            rows,
            references: labels.into_iter().enumerate().map(reference).collect(),
        }
    };
    (0..n_panels).map(panel).collect()
}

#[test]
fn forests_are_legible() {
    let names = specimen_names(200);
    for (n_panels, sizes) in [
        (1, vec![1]),
        (2, vec![8, 1]),
        (3, vec![8, 6, 7]),
        (3, vec![120, 120]),
        (4, vec![200, 1, 13, 12, 5, 0, 40, 3, 2]),
        (2, vec![12; 9]),
        (4, vec![4; 9]),
    ] {
        let what = format!("{n_panels} panels of {sizes:?}");
        let figure = |title: &str, sentence: &str, referenced: bool| {
            let mut panels = panels(n_panels, &sizes, &names);
            if !referenced {
                panels.iter_mut().for_each(|panel| panel.references.clear());
            }
            forest(&Forest { title, sentence, panels }).unwrap()
        };
        assert_legible(&what, &figure("Species", "One sentence.", false));
        assert_legible(&what, &figure(LONG, &[LONG; 3].join(". "), true));
        let again = figure("Species", "One sentence.", true).document();
        assert_eq!(again, figure("Species", "One sentence.", true).document());
    }
}

#[test]
fn forests_without_groups_or_with_odd_numbers_are_refused() {
    let names = specimen_names(3);
    type Change = fn(&mut Vec<ForestPanel>);
    let message = |change: Change| {
        let mut panels = panels(2, &[3, 2], &names);
        change(&mut panels);
        forest(&Forest { title: "", sentence: "", panels }).map(|_| ()).unwrap_err().to_string()
    };
    let refused: [(Change, &str); 9] = [
        (|panels| panels.clear(), "no parameters"),
        (|panels| panels.iter_mut().for_each(|panel| panel.rows.clear()), "no groups"),
        (|panels| drop(panels[1].rows.pop()), "differ from the first panel's"),
        (|panels| panels[1].rows[0].specimens[0].name = "another", "differ from the first panel's"),
        (|panels| panels[0].rows[1].typical[1] = f64::NAN, "E (Pa), bovine: the summary"),
        (|panels| panels[0].rows[1].new_specimen[0] = 0.0, "the summary"),
        (|panels| panels[0].rows[0].specimens[2].unpooled = [3.0, 2.0, 4.0], "specimen 3: the estimate"),
        (|panels| panels[0].rows[0].specimens[2].pooled[2] = f64::INFINITY, "specimen 3: the estimate"),
        (|panels| panels[0].references[0].value = -1.0, "the reference `Lee 1992` is -1"),
    ];
    for (change, words) in refused {
        let message = message(change);
        assert!(message.contains(words), "`{words}` in {message}");
    }
}

/// Values of the SVG attribute `key` in all lines that contain `needle`.
fn numbers_of(svg: &Svg, needle: &str, key: &str) -> Vec<f64> {
    let key = format!(" {key}=\"");
    let number = |line: &str| line.split(&key).nth(1)?.split('"').next()?.parse().ok();
    svg.document().lines().filter(|line| line.contains(needle)).filter_map(number).collect()
}

/// Equal ratios have equal lengths. The bars from 0.9 to 1.1 times 3.5 and 4.55 have equal widths, and their distance corresponds to a factor of 1.3.
#[test]
fn bars_stand_where_the_quantiles_say() {
    let names = specimen_names(4);
    let svg = forest(&Forest { title: "t", sentence: "s", panels: panels(1, &[4, 4], &names) }).unwrap();
    let bar = |group: usize| {
        let needle = format!("height=\"12\" fill=\"{}\"", series(group));
        (numbers_of(&svg, &needle, "x")[0], numbers_of(&svg, &needle, "width")[0])
    };
    let (first, second) = (bar(0), bar(1));
    assert!((first.1 - second.1).abs() < 0.02, "{first:?} {second:?}");
    let expected = 1.3f64.ln() / (1.1f64 / 0.9).ln();
    assert!(((second.0 - first.0) / first.1 - expected).abs() < 1e-3, "{first:?} {second:?}");
    // Two of eight specimens are outlying. Each has a diamond in the panel and one at its name; the fifth diamond is in the legend.
    assert_eq!(svg.document().matches("stroke=\"#1f2328\" stroke-width=\"1.3\"").count(), 5);
}

/// The wide interval of a specimen with little data does not compress the others. It leaves the frame, where an arrow tip is drawn.
#[test]
fn endless_intervals_leave_the_frame() {
    let names = specimen_names(4);
    let width = |lower: f64| {
        let mut panels = panels(1, &[4, 4], &names);
        panels[0].references.clear();
        panels[0].rows[0].specimens[0].unpooled[0] *= lower;
        let svg = forest(&Forest { title: "t", sentence: "s", panels }).unwrap();
        let needle = format!("height=\"12\" fill=\"{}\"", series(0));
        (
            numbers_of(&svg, &needle, "width")[0],
            svg.document().matches("Z\" fill-rule=\"evenodd\" fill=\"#0072b2\"").count(),
        )
    };
    let ((usual, no_tips), (endless, tips)) = (width(1.0), width(1e-30));
    assert!(endless > 0.7 * usual, "{usual} {endless}");
    assert_eq!(tips, no_tips + 1);
}

fn cell(log_ratio: f64, sd: f64) -> ContrastCell {
    let probability = |z: f64| (1.0 + (0.8 * z).tanh()) / 2.0;
    ContrastCell {
        ratio: [-1.645, 0.0, 1.645].map(|z| (log_ratio + z * sd).exp()),
        probability_greater: probability(log_ratio / sd),
        probability_beyond_margin: probability((log_ratio - 1.1f64.ln()) / sd),
        is_declared: log_ratio.abs() > 3.0 * sd,
    }
}

fn matrix(n_groups: usize, n_panels: usize, size: f64) -> Vec<ContrastPanel<'static>> {
    let level = |panel: usize, group: usize| size * wobble(7 * panel + group);
    let one = |panel: usize, a: usize, b: usize| (a != b).then(|| cell(level(panel, a) - level(panel, b), 0.1));
    let row = |panel, a| (0..n_groups).map(|b| one(panel, a, b)).collect();
    let panel = |panel: usize| ContrastPanel {
        label: LABELS[panel].into(),
        groups: NAMES[..n_groups].to_vec(),
        cells: (0..n_groups).map(|a| row(panel, a)).collect(),
    };
    (0..n_panels).map(panel).collect()
}

#[test]
fn contrast_matrices_are_legible() {
    for (n_groups, n_panels, size) in
        [(2, 1, 0.1), (2, 3, 0.5), (3, 3, 0.4), (4, 2, 2.0), (6, 3, 1.0), (9, 4, 0.5), (9, 1, 50.0)]
    {
        let figure = |title, sentence: &str| {
            let panels = matrix(n_groups, n_panels, size);
            contrast_matrix(&ContrastMatrix { title, sentence, margin: 0.1, panels }).unwrap()
        };
        let what = format!("{n_groups} groups, {n_panels} panels");
        assert_legible(&what, &figure("Species", "One sentence."));
        assert_legible(&what, &figure(LONG, &[LONG; 3].join(". ")));
        assert_eq!(figure("", "").document(), figure("", "").document());
    }
}

#[test]
fn contrasts_of_nothing_and_odd_numbers_are_refused() {
    let message = |margin: f64, change: &dyn Fn(&mut Vec<ContrastPanel>)| {
        let mut panels = matrix(3, 2, 0.4);
        change(&mut panels);
        contrast_matrix(&ContrastMatrix { title: "", sentence: "", margin, panels })
            .map(|_| ())
            .unwrap_err()
            .to_string()
    };
    let of = |panels: &mut Vec<ContrastPanel>, change: &dyn Fn(&mut ContrastCell)| {
        change(panels[1].cells[0][1].as_mut().unwrap());
    };
    assert!(message(f64::NAN, &|_| {}).contains("a margin of NaN"));
    assert!(message(0.1, &|panels| panels.clear()).contains("no parameters"));
    assert!(message(0.1, &|panels| panels[0].groups.truncate(1)).contains("1 groups"));
    assert!(
        message(0.1, &|panels| drop(panels[1].cells.pop()))
            .contains("c₁ (Pa·s): the cells do not form a square of 3 rows")
    );
    let nan = message(0.1, &|panels| of(panels, &|cell| cell.ratio[2] = f64::NAN));
    assert!(nan.contains("c₁ (Pa·s), porcine over bovine: the quantiles"), "{nan}");
    assert!(message(0.1, &|panels| of(panels, &|cell| cell.ratio = [2.0, 1.0, 3.0])).contains("the quantiles"));
    assert!(message(0.1, &|panels| of(panels, &|cell| cell.probability_greater = 1.5)).contains("the probabilities"));
}

/// In one cell the row's group is certainly three times the column's. It has a strong warm colour, the cell of the inverse ratio a strong cold one, and both
/// are framed. Cells of uncertain sign are nearly white.
#[test]
fn colours_say_direction_and_sureness() {
    let figure = |log_ratio: f64, sd: f64| {
        let cells = vec![vec![None, Some(cell(log_ratio, sd))], vec![Some(cell(-log_ratio, sd)), None]];
        let panel = ContrastPanel { label: "E (Pa)".into(), groups: vec!["a", "b"], cells };
        contrast_matrix(&ContrastMatrix { title: "", sentence: "", margin: 0.1, panels: vec![panel] }).unwrap()
    };
    let colours = |svg: &Svg| -> Vec<Colour> {
        let hex =
            |line: &str| line.split("fill=\"#").nth(1).and_then(|rest| u32::from_str_radix(rest.get(..6)?, 16).ok());
        let document = svg.document();
        let lines =
            document.lines().filter(|line| line.starts_with("<rect") && line.contains("width=\"98\" height=\"66\""));
        let bytes = |hex: u32| Colour((hex >> 16) as u8, (hex >> 8) as u8, hex as u8);
        lines.filter_map(hex).map(bytes).collect()
    };
    let sure = figure(3f64.ln(), 0.05);
    // Colours of the legend's sample, of the two cells on the diagonal, and of the two other cells.
    let [_, _, warm, cold, _] = colours(&sure)[..] else { panic!("{:?}", colours(&sure)) };
    assert!(warm.0 > warm.2 + 100 && cold.2 > cold.0 + 100, "{warm:?} {cold:?}");
    let text = sure.document();
    assert!(
        text.contains(">3.00<") && text.contains(">0.33<") && text.matches("&gt;0.999 · &gt;0.999").count() == 2,
        "{text}"
    );
    assert_eq!(text.matches("stroke-width=\"3\"").count(), 3, "the sample and both cells are framed");
    let unsure = figure(3f64.ln(), 5.0);
    let [_, _, warm, cold, _] = colours(&unsure)[..] else { panic!("{:?}", colours(&unsure)) };
    assert!([warm.0, warm.1, warm.2, cold.0, cold.1, cold.2].iter().all(|channel| *channel > 225), "{warm:?} {cold:?}");
    assert_eq!(unsure.document().matches("stroke-width=\"3\"").count(), 1);
}

const TIME_S: [f64; 5] = [0.01, 0.1, 1.0, 10.0, 100.0];

/// A group with the creep compliance `level` t^0.4, known to a factor of 1.2. For a new specimen it is known to a factor of `vague`.
fn creep(group: usize, level: f64, vague: f64) -> CreepGroup<'static> {
    let times = |factor: f64| TIME_S.map(|time_s| level * time_s.powf(0.4) * factor).to_vec();
    CreepGroup {
        label: NAMES[group],
        colour: series(group),
        median_per_pa: times(1.0),
        typical_90_per_pa: [times(1.0 / 1.2), times(1.2)],
        new_specimen_90_per_pa: [times(1.0 / vague), times(vague)],
    }
}

#[test]
fn creep_bands_are_legible() {
    for (n_groups, level, spread) in
        [(1, 0.2, 0.1), (2, 3e-7, 0.0), (3, 0.2, 0.0), (4, 5.0, 0.1), (5, 1e5, 0.4), (7, 0.2, 0.2), (9, 3e-7, 1.0)]
    {
        let groups = || (0..n_groups).map(|group| creep(group, level * (spread * wobble(group)).exp(), 2.0)).collect();
        let figure = |title, sentence: &str| {
            creep_bands(&CreepBands { title, sentence, time_s: &TIME_S, groups: groups() }).unwrap()
        };
        assert_legible(&format!("{n_groups} groups"), &figure("Creep", "One sentence."));
        assert_legible(&format!("{n_groups} groups"), &figure(LONG, &[LONG; 3].join(". ")));
        assert_eq!(figure("", "").document(), figure("", "").document());
    }
}

#[test]
fn creep_of_nothing_and_odd_numbers_are_refused() {
    let message = |time_s: &[f64], change: &dyn Fn(&mut Vec<CreepGroup>)| {
        let mut groups = vec![creep(0, 1.0, 2.0), creep(1, 2.0, 2.0)];
        change(&mut groups);
        creep_bands(&CreepBands { title: "", sentence: "", time_s, groups }).map(|_| ()).unwrap_err().to_string()
    };
    assert!(message(&TIME_S, &|groups| groups.clear()).contains("there are 5 times and 0 groups"));
    assert!(message(&[0.0, 0.1, 1.0, 10.0, 100.0], &|_| {}).contains("remove 0 s"));
    assert!(message(&[0.1, 0.1, 1.0, 10.0, 100.0], &|_| {}).contains("positive and increasing"));
    assert!(message(&TIME_S[..4], &|_| {}).contains("porcine: the curves have [5, 5, 5, 5, 5] values for 4 times"));
    assert!(
        message(&TIME_S, &|groups| groups[1].median_per_pa[2] = f64::NAN).contains("bovine: at 1 s the compliance")
    );
    assert!(message(&TIME_S, &|groups| groups[1].new_specimen_90_per_pa[0][3] = 0.0).contains("bovine: at 10 s"));
    assert!(message(&TIME_S, &|groups| groups[0].typical_90_per_pa.swap(0, 1)).contains("wrong order at 0.01 s"));
    assert!(message(&TIME_S, &|groups| groups[0].new_specimen_90_per_pa.swap(0, 1)).contains("wrong order"));
}

/// On logarithmic axes a power law is a straight line. Five times in equal ratios have equal distances, and so do their compliances.
#[test]
fn power_laws_are_straight() {
    let data = CreepBands { title: "", sentence: "", time_s: &TIME_S, groups: vec![creep(0, 0.2, 2.0)] };
    let document = creep_bands(&data).unwrap().document();
    let line = document.lines().filter(|line| line.contains("stroke-width=\"2.2\"") && line.matches('L').count() == 4);
    let path = line.filter_map(|line| line.split('"').nth(1)).next().unwrap();
    let points: Vec<Vec<f64>> =
        path[1..].split('L').map(|point| point.split(' ').map(|number| number.parse().unwrap()).collect()).collect();
    for pair in points.windows(2) {
        let (dx, dy) = (pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]);
        assert!((dx - (points[4][0] - points[0][0]) / 4.0).abs() < 0.02, "{points:?}");
        assert!((dy - (points[4][1] - points[0][1]) / 4.0).abs() < 0.02 && dy < -10.0, "{points:?}");
    }
}
