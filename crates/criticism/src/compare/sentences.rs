//! Sentences of the document of a comparison.

use documents::comparison::{ColumnBias, Comparison, Finding, TestEntry};
use figures::number::format_significant;
use posterior::misfit::{Misfit, NOISE_FACTOR};
use posterior::patterns::panels::lag_phrase;

/// Fraction of the largest bar (bias of one column) that its neighbours in time must exceed to be described together with it.
const SHARE_OF_LARGEST: f64 = 0.5;
/// Least distance of a bar from zero, in standard errors, at which a sentence names its place.
const CLEAR: f64 = 3.0;
/// Least size of a bar whose place a sentence names, as a fraction of the root mean square bias.
const LEAST_SHARE: f64 = 0.5;

/// Describes a significant test as a finding. `echo_of` is the test that explains it, if any.
pub fn describe_finding(entry: &TestEntry, noise_um: Option<f64>, echo_of: Option<&TestEntry>) -> Finding {
    let is_telling = |k: &usize| entry.rms_um.is_some_and(|rms_um| is_clear(&entry.bars[*k], rms_um));
    let clearest = clearest(&entry.bars).filter(is_telling);
    let bar = clearest.map(|k| &entry.bars[k]);
    let sentence = match (about_whiteness(entry), clearest) {
        (Some(sentence), _) => sentence,
        (None, Some(clearest)) => about_place(entry, clearest, noise_um),
        (None, None) => about_whole(entry, noise_um),
    };
    Finding {
        place: entry.place.clone(),
        sentence,
        size_um: bar.map(|bar| bar.bias_um.abs()).or(entry.rms_um),
        size_sd_um: bar.map(|bar| bar.sd_um),
        echo_of: echo_of.map(|source| source.place.clone()),
        p_familywise: entry.p_familywise,
    }
}

fn over_error(bar: &ColumnBias) -> f64 {
    bar.bias_um.abs() / bar.sd_um.max(f64::MIN_POSITIVE)
}

fn is_clear(bar: &ColumnBias, rms_um: f64) -> bool {
    over_error(bar) >= CLEAR && bar.bias_um.abs() > LEAST_SHARE * rms_um
}

/// Writes a value and its error, rounded to the error's first digit.
fn with_error(value: f64, sd: f64) -> String {
    let place = sd.max(f64::MIN_POSITIVE).log10().floor().clamp(-6.0, 6.0);
    let rounded = |x: f64| (x / 10_f64.powf(place)).round() * 10_f64.powf(place);
    let decimals = (-place).max(0.0) as usize;
    format!("{:.decimals$} ± {:.decimals$}", rounded(value), rounded(sd))
}

/// Returns the index of the bar with the largest ratio to its error.
fn clearest(bars: &[ColumnBias]) -> Option<usize> {
    (0..bars.len()).max_by(|a, b| over_error(&bars[*a]).total_cmp(&over_error(&bars[*b])))
}

/// Phrase for the size (µm) that noise may explain; empty if the noise is unknown.
fn of_noise(noise_um: Option<f64>) -> String {
    noise_um.map_or(String::new(), |noise_um| format!("; noise explains {} µm", format_significant(noise_um, 2)))
}

fn about_place(entry: &TestEntry, clearest: usize, noise_um: Option<f64>) -> String {
    let bar = &entry.bars[clearest];
    format!(
        "The model misses {} µm{}, mostly {}{}.",
        with_error(bar.bias_um.abs(), bar.sd_um),
        direction(entry, bar),
        phrase(&entry.bars, clearest),
        of_noise(noise_um)
    )
}

fn about_whole(entry: &TestEntry, noise_um: Option<f64>) -> String {
    format!(
        "The model misses {} µm (root mean square) {}, and no single place stands out{}.",
        format_significant(entry.rms_um.unwrap_or(0.0), 2),
        whole(&entry.place),
        of_noise(noise_um)
    )
}

/// Phrase for the quantity that a test examines, for the end of a sentence.
fn whole(place: &str) -> &'static str {
    match place {
        "input_correlation" => "in step with earlier changes of the force",
        "time_since_step" => "as a function of the time since the last force step",
        "cycle" => "differently from cycle to cycle",
        "force_sign" => "differently for each sign of the force",
        "force_level" => "differently for each level of the force",
        "position" => "as a function of the position",
        "velocity" => "as a function of the velocity",
        "loading" => "differently in loading and recovery",
        "superposition" => "in how the response grows with the force",
        "reversal" => "in one direction for either sign of the force",
        "trend" => "slowly over the record",
        _ => "at the harmonics of the force",
    }
}

/// Phrase for the direction in which the measurement deviates from the model.
fn direction(entry: &TestEntry, bar: &ColumnBias) -> &'static str {
    let is_ahead = bar.bias_um > 0.0;
    match entry.place.as_str() {
        "time_since_step" | "input_correlation" if is_ahead => " (the bead is ahead of it)",
        "time_since_step" | "input_correlation" => " (the bead lags behind it)",
        "harmonics" | "trend" | "superposition" => "",
        _ if entry.is_along_force && is_ahead => " (the bead goes farther)",
        _ if entry.is_along_force => " (the bead goes less far)",
        _ if is_ahead => " (the bead is above it)",
        _ => " (the bead is below it)",
    }
}

/// Phrase for where the clearest bar lies, together with neighbours in time that resemble it.
fn phrase(bars: &[ColumnBias], clearest: usize) -> String {
    let bar = &bars[clearest];
    let is_plain = bar.lag_s.is_some_and(|lag_s| bar.phrase == lag_phrase(lag_s));
    if !is_plain {
        return bar.phrase.clone();
    }
    let is_like = |k: usize| bars[k].bias_um * bar.bias_um.signum() > SHARE_OF_LARGEST * bar.bias_um.abs();
    let first = (0..clearest).rev().take_while(|k| is_like(*k)).last().unwrap_or(clearest);
    let last = (clearest + 1..bars.len()).take_while(|k| is_like(*k)).last().unwrap_or(clearest);
    match (bars[first].lag_s, bars[last].lag_s) {
        (Some([from, _]), Some([_, to])) => lag_phrase([from, to]),
        _ => bar.phrase.clone(),
    }
}

fn about_whiteness(entry: &TestEntry) -> Option<String> {
    match entry.place.as_str() {
        "runs" => {
            let kind = if entry.bars.first().is_some_and(|bar| bar.bias_um < 0.0) { "longer" } else { "shorter" };
            Some(format!(
                "The whitened residuals keep one sign for {kind} runs than by chance: noise of the assumed kind does not explain them."
            ))
        }
        "autocorrelation" => {
            let bar = &entry.bars[clearest(&entry.bars)?];
            Some(format!(
                "The whitened residuals are correlated, {} {}: noise of the assumed kind does not explain them.",
                format_significant(bar.bias_um, 2),
                bar.phrase
            ))
        }
        _ => None,
    }
}

/// Overall sentence of the comparison. `judged` is the misfit by the thresholds of `diagnose`; `None` if the noise is unknown.
pub fn describe_comparison(comparison: &Comparison, judged: Option<Misfit>) -> String {
    let um = |value: f64| format_significant(value, 2);
    let noise_um = comparison.noise_um;
    let (n, of) = (comparison.findings.len(), comparison.panels.len());
    let heldout = comparison
        .rmse_heldout_um
        .map_or("; no cycle is held out".into(), |rmse| format!(" and {} µm on the last held-out cycle", um(rmse)));
    let fitted = um(comparison.rmse_fitted_um);
    let noise = noise_um.map_or("unknown".into(), |noise_um| format!("{} µm", um(noise_um)));
    let misfit = format!("misfit {fitted} µm on the fitted cycles{heldout}; noise {noise}");
    let heldout = judged.and_then(|misfit| misfit.heldout).filter(|heldout| heldout.is_too_large);
    if let Some(first) = comparison.findings.first() {
        let place = first.place.replace('_', " ");
        let also = heldout.map_or("", |_| " The error on the last held-out cycle exceeds the noise, too.");
        return format!("The model fails in {n} of {of} tests, most clearly {place} ({misfit}).{also}");
    }
    if let Some(rmse) = comparison.rmse_heldout_um.filter(|_| heldout.is_some()) {
        let times = noise_um.map_or(String::new(), |noise_um| format!(", {} times the noise", um(rmse / noise_um)));
        return format!(
            "The model does not predict the last held-out cycle: its error there is {} µm{times}, although none of {of} tests of the \
             fitted cycles distinguishes the misfit from noise ({misfit}). The cycles differ, perhaps only in their gain.",
            um(rmse),
        );
    }
    let is_large = |misfit: Misfit| comparison.rmse_fitted_um > NOISE_FACTOR * 1e6 * misfit.noise_m;
    let doubt = match judged {
        None => {
            " The noise is neither given nor can it be estimated, so a misfit that looks like noise cannot be ruled out."
        }
        Some(misfit) if is_large(misfit) => {
            " The misfit looks like noise but exceeds the known noise, so it cannot be ruled out."
        }
        Some(_) => "",
    };
    format!("Nothing found: none of {of} tests distinguishes the misfit from noise ({misfit}).{doubt}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use posterior::misfit::ResidualSize;

    fn bar(bias_um: f64, sd_um: f64, lag_s: [f64; 2]) -> ColumnBias {
        ColumnBias {
            label: String::new(),
            phrase: lag_phrase(lag_s),
            lag_s: Some(lag_s),
            stretches_s: Vec::new(),
            bias_um,
            sd_um,
        }
    }

    fn entry(bars: Vec<ColumnBias>) -> TestEntry {
        TestEntry {
            place: "time_since_step".into(),
            title: String::new(),
            is_along_force: true,
            gain_nats: 20.0,
            gain_by_chance_nats: 2.0,
            rms_um: Some(1.21),
            p: 1e-6,
            p_familywise: 0.005,
            bars,
        }
    }

    #[test]
    fn like_neighbours_in_time_make_one_place() {
        let bars = vec![bar(-12.0, 2.0, [0.0, 0.1]), bar(-9.0, 2.0, [0.1, 0.3]), bar(-3.0, 2.0, [0.3, 1.0])];
        let finding = describe_finding(&entry(bars), Some(4.0), None);
        let expected = "The model misses 12 ± 2 µm (the bead lags behind it), mostly within 0.30 s after each force step; noise explains 4.0 µm.";
        assert_eq!((finding.sentence.as_str(), finding.size_um, finding.size_sd_um), (expected, Some(12.0), Some(2.0)));
    }

    #[test]
    fn values_are_rounded_to_their_errors() {
        for (value, sd, expected) in [(187.3, 5.2, "187 ± 5"), (173.0, 22.0, "170 ± 20"), (0.97, 0.31, "1.0 ± 0.3")]
        {
            assert_eq!(with_error(value, sd), expected);
        }
    }

    #[test]
    fn a_feeble_bar_is_no_place() {
        let finding =
            describe_finding(&entry(vec![bar(0.59, 0.3, [0.0, 0.1]), bar(-0.5, 0.3, [0.1, 0.3])]), Some(4.0), None);
        assert!(finding.sentence.contains("1.2 µm (root mean square)"), "{}", finding.sentence);
        assert!(!finding.sentence.contains('±'), "{}", finding.sentence);
        assert_eq!((finding.size_um, finding.size_sd_um), (Some(1.21), None));
    }

    #[test]
    fn a_held_out_cycle_far_off_is_said_first() {
        let mut comparison = Comparison {
            experiment: String::new(),
            effects: Vec::new(),
            fitted_cycles: vec![1, 2, 3],
            heldout_cycles: vec![4],
            outlier_rows: Vec::new(),
            rmse_fitted_um: 4.2,
            rmse_heldout_um: Some(14.0),
            noise_um: Some(4.0),
            sentence: String::new(),
            findings: Vec::new(),
            panels: vec![entry(Vec::new())],
            left_out: Vec::new(),
            simulated_records: 199,
        };
        let size = |rms_um: f64| ResidualSize { rms_m: 1e-6 * rms_um, is_too_large: rms_um > 6.0 };
        let judged = |heldout_um: f64| {
            let (fitted, heldout) = (size(4.2), Some(size(heldout_um)));
            Some(Misfit {
                fitted,
                heldout,
                noise_m: 4e-6,
                is_known: true,
                implausible_gains: None,
                returning_m: None,
                learnt_degrees: 1.0,
            })
        };
        let said = describe_comparison(&comparison, judged(14.0));
        assert!(
            said.starts_with("The model does not predict the last held-out cycle") && said.contains("3.5 times"),
            "{said}"
        );
        comparison.rmse_heldout_um = Some(4.4);
        let sound = describe_comparison(&comparison, judged(4.4));
        assert!(sound.starts_with("Nothing found") && !sound.contains("cannot be ruled out"), "{sound}");
        comparison.noise_um = None;
        let unknown = describe_comparison(&comparison, None);
        assert!(unknown.contains("noise unknown") && unknown.contains("cannot be ruled out"), "{unknown}");
    }
}
