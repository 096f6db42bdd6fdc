//! Recommendations in words.

use criticism::protocol::DesignLimits;
use criticism::protocol::design::{DesignedProtocol, N_REPEATS, separates};
use documents::design::{DesignedDetection, DesignedParameter, DesignedQuantity};
use documents::posterior::{Warning, WarningKind};
use figures::labels::parameter_label;
use figures::number::format_significant;
use prediction::quantity::plain;

/// Ratio of the expected and the present standard deviation above which a record does not pay.
const LITTLE_LEARNT: f64 = 0.9;

/// Cause that keeps another record from teaching more.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BindingLimit {
    /// A gain of each cycle, as a term of the noise.
    Gain,
    /// The distance of the robot from the outer surface of the gel.
    OuterSurface,
    /// The displacement limit.
    Displacement,
    /// Force, duration and number of samples.
    Other,
}

/// Reason to stop if a record would lower no standard deviation by more than 10 %. `sd` are the present and the expected ones.
pub fn stop_sentence(
    limits: &DesignLimits,
    mut sd: impl Iterator<Item = [f64; 2]>,
    binding: BindingLimit,
) -> Option<String> {
    sd.all(|[now, expected]| expected > LITTLE_LEARNT * now).then(|| {
        let remedy = match binding {
            // A designed record is one cycle, whose gain is unknown however long it is.
            BindingLimit::Gain => {
                "Each cycle has its own gain, and a designed record is one cycle: a record of more cycles would teach more.".into()
            }
            BindingLimit::OuterSurface => {
                "The gel's outer surface limits the displacement: more time or samples would teach more.".into()
            }
            BindingLimit::Displacement => format!(
                "The displacement limit of {} µm binds: a larger one would teach more.",
                format_significant(1e6 * limits.largest_position_m, 3)
            ),
            BindingLimit::Other => String::from("More force, time or samples would teach more."),
        };
        format!(
            "Another record of {} s within these limits lowers no standard deviation by more than 10 %. {remedy}",
            format_significant(limits.duration_s, 3)
        )
    })
}

/// The protocol as an instruction.
fn instruction(best: &DesignedProtocol, limits: &DesignLimits) -> String {
    format!("Apply {} ({} s in all).", best.drive.described(limits), format_significant(limits.duration_s, 3))
}

pub fn with_quantity(
    best: &DesignedProtocol,
    limits: &DesignLimits,
    quantity: &DesignedQuantity,
    has_tolerances: bool,
) -> String {
    let unit = quantity.unit.replace("um", "µm");
    let unit = if unit == "1" { String::new() } else { format!(" {unit}") };
    let [value, now, then] =
        [quantity.value, quantity.sd_now, quantity.sd_expected].map(|value| format_significant(value, 3));
    format!(
        "{} The {} of {} ({value}{unit}) becomes known to ± {then}{unit} (now ± {now}{unit}){}.",
        instruction(best, limits),
        quantity.quantity,
        quantity.scenario,
        if has_tolerances { ", beside the scenario's tolerances, which no record of the gel reduces" } else { "" }
    )
}

pub fn with_detection(best: &DesignedProtocol, limits: &DesignLimits, detectable: &[DesignedDetection]) -> String {
    let opened: Vec<&str> = detectable
        .iter()
        .filter(|found| found.smallest_now.is_none() && found.smallest_expected.is_some())
        .map(|found| found.effect.as_str())
        .collect();
    let blind = detectable.iter().filter(|found| found.smallest_expected.is_none()).count();
    let visible = detectable.len() - blind;
    let mut text = format!(
        "{} The new record shows {visible} of {} effects at some size of their priors.",
        instruction(best, limits),
        detectable.len()
    );
    if !opened.is_empty() {
        text += &format!(" Visible for the first time: {}.", opened.join(", "));
    }
    text
}

pub fn sentence(
    best: &DesignedProtocol,
    limits: &DesignLimits,
    now: Option<f64>,
    right: Option<usize>,
    effects: &[String],
    parameters: &[DesignedParameter],
) -> String {
    let short = |value: f64| format_significant(value, 3);
    let mut text = instruction(best, limits);
    if let (Some((distance, other)), Some(right)) = (best.closest, right) {
        let verb = if separates(distance) { "This separates" } else { "This does not separate" };
        text += &format!(
            " {verb} {} from {}: their distance is {} σ in the new record{}, and the true effect is recognised in {right} of {N_REPEATS} simulated records.",
            effects[0],
            effects[other],
            short(distance),
            now.map_or(String::new(), |now| format!(" ({} σ in all cycles of the present one)", short(now)))
        );
    }
    let improved = parameters.iter().min_by(|a, b| (a.sd_expected / a.sd_now).total_cmp(&(b.sd_expected / b.sd_now)));
    if let Some(parameter) = improved {
        let percent = |sd: f64| short(100.0 * sd / parameter.value.abs());
        text += &format!(
            " {} becomes known to ± {} % (now ± {} %).",
            parameter_label(&parameter.name).symbol,
            percent(parameter.sd_expected),
            percent(parameter.sd_now)
        );
    }
    text
}

/// Warning about a displacement limit at the outer surface of the gel; `None` for other limits. `asked_m` is the limit that the user gave, `free_m` the distance after which
/// the robot touches the surface, and `is_reached` tells whether the recommended protocol moves the robot up to its limit.
pub fn at_the_outer_surface(
    asked_m: Option<f64>,
    free_m: Option<f64>,
    limits: &DesignLimits,
    is_reached: bool,
) -> Option<Warning> {
    let free_m = free_m.filter(|free_m| limits.largest_position_m >= *free_m)?;
    let um = |metres: f64| format_significant(1e6 * metres, 4);
    let asked = asked_m.filter(|asked_m| *asked_m > free_m);
    let asked =
        asked.map_or(String::new(), |m| format!("; the limit of {} µm that was given lies beyond it", plain(1e6 * m)));
    let binds = if is_reached { ". It limits the force of the recommended protocol" } else { "" };
    Some(Warning {
        kind: WarningKind::Extrapolation,
        text: format!(
            "the displacement limit is {} µm, where the robot touches the gel's outer surface{asked}{binds}",
            um(free_m)
        ),
        advice: "give a displacement limit far below it: near the outer surface the gel is stiffer than the model"
            .into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use criticism::protocol::ForceDirections;

    fn limits(largest_position_m: f64) -> DesignLimits {
        DesignLimits {
            largest_force_n: 4.6e-6,
            duration_s: 40.0,
            interval_s: 0.05,
            shortest_hold_s: 0.2,
            largest_position_m,
            directions: ForceDirections::Both,
        }
    }

    #[test]
    fn the_reason_to_stop_names_the_limit_that_binds() {
        let sentence = |binding| stop_sentence(&limits(1.23e-3), [[1.0, 0.95]].into_iter(), binding).expect("a reason");
        assert!(sentence(BindingLimit::Gain).contains("Each cycle has its own gain"));
        let displacement = sentence(BindingLimit::Displacement);
        assert!(displacement.ends_with("The displacement limit of 1230 µm binds: a larger one would teach more."));
        assert!(sentence(BindingLimit::OuterSurface).contains("The gel's outer surface limits the displacement"));
        let other = sentence(BindingLimit::Other);
        assert!(other.ends_with("More force, time or samples would teach more.") && !other.contains("gain"));
        // A record that lowers one standard deviation by more than 10 % is worth its time.
        assert_eq!(stop_sentence(&limits(1e-3), [[1.0, 0.95], [1.0, 0.8]].into_iter(), BindingLimit::Other), None);
    }

    #[test]
    fn a_limit_at_the_outer_surface_is_named() {
        let free_m = Some(9.725e-3);
        let found = at_the_outer_surface(Some(0.1), free_m, &limits(9.725e-3), true).expect("a warning").text;
        assert!(found.contains("9725 µm, where the robot touches the gel's outer surface"), "{found}");
        assert!(found.contains("the limit of 100000 µm that was given lies beyond it"), "{found}");
        assert!(found.contains("limits the force of the recommended protocol"), "{found}");
        let of_record = at_the_outer_surface(None, free_m, &limits(9.725e-3), false).expect("a warning").text;
        assert!(!of_record.contains("given") && !of_record.contains("limits the force"), "{of_record}");
        assert_eq!(at_the_outer_surface(Some(2e-3), free_m, &limits(2e-3), true), None);
        assert_eq!(at_the_outer_surface(Some(0.1), None, &limits(0.1), true), None);
    }
}
