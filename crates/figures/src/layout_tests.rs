//! Tests the layout of all figures with the renderer: no two texts overlap, and no text leaves the page.

use std::sync::{Arc, OnceLock};

use resvg::{tiny_skia, usvg};

use super::corner::{CornerOptions, ParameterColumn, Posterior, PriorCurve, corner};
use super::density::Support;
use super::font;
use super::palette::series;
use super::predictive::{Band, CycleKind, CycleSpan, PredictiveData, predictive};
use super::singular_values::{Family, singular_values};
use super::svg::Svg;
use super::trace::{EnsembleTrace, ParameterTrace, trace};

pub(super) const LONG: &str =
    "human donor 17, left eye, central vitreous, 36 hours post mortem, second insertion, temperature 37 °C, repeated";

/// Font database that contains only the embedded font.
pub(super) fn database() -> Arc<usvg::fontdb::Database> {
    static DATABASE: OnceLock<Arc<usvg::fontdb::Database>> = OnceLock::new();
    Arc::clone(DATABASE.get_or_init(|| {
        let mut database = usvg::fontdb::Database::new();
        database.load_font_data(font::FONT.to_vec());
        Arc::new(database)
    }))
}

fn tree(svg: &Svg) -> usvg::Tree {
    let options = usvg::Options { fontdb: database(), ..usvg::Options::default() };
    usvg::Tree::from_str(&svg.document(), &options).unwrap()
}

/// Checks that the PNG and another renderer's picture of the SVG agree. Colour channels may differ by less than 4 of 255 on average, because that renderer uses
/// kerning.
fn assert_same_picture(what: &str, svg: &Svg) {
    let pixmap = tiny_skia::Pixmap::decode_png(&svg.png().unwrap()).unwrap();
    let mut other = tiny_skia::Pixmap::new(pixmap.width(), pixmap.height()).unwrap();
    resvg::render(&tree(svg), tiny_skia::Transform::from_scale(1.5, 1.5), &mut other.as_mut());
    let differences = pixmap.data().iter().zip(other.data()).map(|(a, b)| f64::from(a.abs_diff(*b)));
    let mean = differences.sum::<f64>() / pixmap.data().len() as f64;
    println!("{what}: mean difference {mean}");
    assert!(mean < 4.0, "{what}: {mean}");
}

/// Text and bounding box of every text in a drawing.
fn texts(svg: &Svg) -> Vec<(String, usvg::Rect)> {
    fn collect(group: &usvg::Group, found: &mut Vec<(String, usvg::Rect)>) {
        for node in group.children() {
            match node {
                usvg::Node::Group(group) => collect(group, found),
                usvg::Node::Text(text) => {
                    let words: String = text.chunks().iter().map(|chunk| chunk.text()).collect();
                    found.push((words, text.flattened().abs_bounding_box()));
                }
                _ => {}
            }
        }
    }
    let tree = tree(svg);
    let mut found = Vec::new();
    collect(tree.root(), &mut found);
    found
}

pub(super) fn assert_legible(what: &str, svg: &Svg) {
    assert_same_picture(what, svg);
    let texts = texts(svg);
    assert!(texts.len() > 5, "{what}: text is found");
    for (i, (words, ink)) in texts.iter().enumerate() {
        let inside = ink.left() >= 0.0
            && ink.top() >= 0.0
            && f64::from(ink.right()) <= svg.width_px()
            && f64::from(ink.bottom()) <= svg.height_px();
        assert!(inside, "{what}: `{words}` leaves the page: {ink:?}");
        for (other, other_ink) in &texts[..i] {
            let (width, height) = (
                ink.right().min(other_ink.right()) - ink.left().max(other_ink.left()),
                ink.bottom().min(other_ink.bottom()) - ink.top().max(other_ink.top()),
            );
            assert!(width <= 0.0 || height <= 0.0, "{what}: `{words}` overlaps `{other}` by {width} × {height} px");
        }
    }
}

/// Deterministic values that are roughly normally distributed.
fn draws(n: usize, seed: f64, centre: f64, sd: f64) -> Vec<f64> {
    let uniform = |i: usize, k: f64| ((i as f64 + 1.0) * (0.754_877_666 + 0.1 * k + seed)).fract();
    (0..n).map(|i| centre + sd * ((0..6).map(|k| uniform(i, f64::from(k))).sum::<f64>() - 3.0)).collect()
}

#[test]
fn corner_plots_are_legible() {
    let named = [
        ("E", "Pa", 3.527, 0.1),
        ("c₁", "Pa·s", 1.402, 0.03),
        ("interface-slip: slip compliance", "m/(Pa·s)", 2.2e-7, 3e-8),
        ("σ", "µm", 4.0, 0.2),
        ("poroelasticity: drained poisson ratio", "–", 0.31, 0.02),
        ("c₂", "Pa·s", 123_456.0, 789.0),
        ("tracking-drift: velocity", "m/s", -1.2e-9, 4e-9),
        ("sd of gain", "–", 0.0, 1e-12),
        ("order", "–", 1e6, 1e-2),
    ];
    let columns: Vec<Vec<f64>> =
        named.iter().enumerate().map(|(i, (.., centre, sd))| draws(400, 0.01 * i as f64, *centre, *sd)).collect();
    let column = |i: usize| {
        let (symbol, unit, centre, sd) = named[i];
        ParameterColumn {
            name: symbol,
            symbol,
            unit,
            draws: &columns[i],
            support: Support::default(),
            prior: Some(PriorCurve { x: &[0.0, 1.0], density: &[1.0, 1.0] }),
            reference: Some(centre + 40.0 * sd),
        }
    };
    // Each number of parameters is tested once with a title and once without. There are one or three posteriors.
    for (n, n_posteriors, title) in [
        (1, 1, ""),
        (1, 3, LONG),
        (2, 3, ""),
        (2, 1, LONG),
        (3, 3, LONG),
        (4, 3, ""),
        (5, 1, LONG),
        (7, 3, ""),
        (9, 1, ""),
    ] {
        let labels = ["m0", LONG, "m2"];
        let posterior =
            |p: usize| Posterior { label: labels[p], colour: series(p), parameters: (0..n).map(column).collect() };
        let posteriors: Vec<Posterior> = (0..n_posteriors).map(posterior).collect();
        let options = CornerOptions { title, ..CornerOptions::default() };
        let what = format!("{n} parameters, {n_posteriors} posteriors, title `{title}`");
        assert_legible(&what, &corner(&posteriors, &options).unwrap());
    }
}

#[test]
fn predictive_figures_are_legible() {
    for (n_cycles, n_rows, force_un, size_um) in
        [(1, 30, 4.6, 900.0), (4, 800, 4.6, 1e-3), (10, 400, 1e-6, 1.3), (60, 3_000, 1e3, 1e7)]
    {
        let time_s: Vec<f64> = (0..n_rows).map(|i| 0.3 * f64::from(i)).collect();
        let cycle_s = 0.3 * f64::from(n_rows) / f64::from(n_cycles);
        let wave: Vec<f64> = time_s.iter().map(|t| size_um * (t / cycle_s).sin()).collect();
        let position_um: Vec<Option<f64>> = wave.iter().map(|w| Some(w * 1.01)).collect();
        let force: Vec<f64> = wave.iter().map(|w| force_un * w.signum()).collect();
        let kind = |i| if i == 0 { CycleKind::Calibration } else { CycleKind::HeldOut };
        let span = |i: i32| CycleSpan {
            cycle: i64::from(i) + 1,
            start_s: f64::from(i) * cycle_s,
            end_s: f64::from(i + 1) * cycle_s,
            kind: kind(i),
        };
        let cycles: Vec<CycleSpan> = (0..n_cycles).map(span).collect();
        let band = Band { lower: &wave, upper: &wave };
        let data = PredictiveData {
            title: LONG,
            time_s: &time_s,
            position_um: &position_um,
            force_un: &force,
            median_um: &wave,
            band_50_um: band,
            band_90_um: band,
            cycles: &cycles,
            noise: Some((0.01 * size_um, "noise estimated from short-lag differences and rest records")),
        };
        assert_legible(&format!("{n_cycles} cycles"), &predictive(&data).unwrap());
    }
}

#[test]
fn traces_and_singular_values_are_legible() {
    let labels = ["E (Pa)", "interface-slip: slip compliance (m/(Pa·s))", "poroelasticity: drained poisson ratio (–)"];
    let series: Vec<Vec<f64>> = (0..3).map(|i| draws(3_000, 0.03 * f64::from(i), 1e-7, 1e-9)).collect();
    let decay: Vec<f64> = (0..300).map(|lag| (-f64::from(lag) / 37.0).exp()).collect();
    let parameter = |i: usize| {
        let ensemble = EnsembleTrace { mean: &series[i], lower: &[], upper: &[], walkers: vec![] };
        ParameterTrace {
            label: labels[i],
            ensembles: vec![ensemble; 8],
            autocorrelation: vec![&decay],
            autocorrelation_time_steps: Some(37.2),
        }
    };
    assert_legible("trace", &trace(&[parameter(0), parameter(1), parameter(2)], 300, LONG).unwrap());
    for n in [1, 3, 24, 200] {
        let values: Vec<f64> = (0..n).map(|k| 10f64.powi(-k)).collect();
        let family = Family { label: LONG, singular_values: &values, n_chosen: 2 };
        assert_legible(&format!("{n} modes"), &singular_values(&[family, family], 1e-6, LONG).unwrap());
    }
}
