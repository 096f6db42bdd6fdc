//! Formats the result of `shapes` as text.

use std::collections::BTreeSet;

use vitreo_uq::documents::shapes::{
    BodyShape, BodySummary, Claim, Displacement, LargeStrains, ShapesSummary, SweepSummary, UserBody,
};
use vitreo_uq::figures::number::format_significant;

use crate::predict::warning_lines;

/// Text and tables of a shape study.
pub fn words(summary: &ShapesSummary) -> String {
    let mut lines = vec![format!(
        "Aspect ratio {:.3}, Poisson ratio {}, gel of {} mm, force ±{} µN",
        summary.aspect,
        summary.poisson_ratio,
        summary.vitreous_diameter_mm,
        format_significant(summary.force_un, 4)
    )];
    lines.push(String::new());
    lines.extend(bodies(summary));
    lines.push(String::new());
    lines.extend(meshes(summary));
    if !summary.sweep.is_empty() {
        lines.push(String::new());
        lines.extend(sweep(&summary.sweep));
    }
    lines.push(String::new());
    lines.push("Claims of the paper:".into());
    lines.extend(summary.claims.iter().map(claim));
    lines.extend(changing_claims(&summary.sweep));
    if let Some(large) = &summary.large_strains {
        lines.push(String::new());
        lines.extend(large_strains(large, summary.hold_s));
    }
    lines.push(String::new());
    lines.extend(elastic(summary));
    lines.push(String::new());
    lines.extend(predictors(summary));
    lines.extend(warning_lines(&summary.warnings));
    lines.join("\n") + "\n"
}

fn name(body: &BodySummary) -> String {
    match &body.orientation {
        Some(orientation) => format!("{}, {orientation}", body.shape.name()),
        None => body.shape.name().into(),
    }
}

fn moved(displacement: Displacement) -> String {
    format!("{:.0} ({:.0}–{:.0}) µm", displacement.median, displacement.q05, displacement.q95)
}

fn bodies(summary: &ShapesSummary) -> Vec<String> {
    let mut lines = vec![format!(
        "  {:<24}{:>10}{:>11}{:>10}{:>10}{:>10}{:>24}",
        "body", "stiffness", "/ sphere", "surface", "error", "3D − 2D", "displacement after 5 s"
    )];
    let mut rule = None;
    for body in &summary.bodies {
        if rule != Some(body.size_rule) {
            lines.push(format!("  at {}", body.size_rule.title()));
            rule = Some(body.size_rule);
        }
        lines.push(format!(
            "    {:<22}{:>7.4} mm{:>11.4}{:>10.3}{:>10.0e}{:>10.0e}{:>24}",
            name(body),
            1e3 * body.stiffness_m,
            body.ratio_to_sphere,
            body.surface_ratio,
            body.relative_error,
            body.relative_difference_3d,
            moved(body.displacement_5s_um)
        ));
    }
    lines.extend(summary.own_body.iter().flat_map(own_body));
    lines
}

fn own_body(user_body: &UserBody) -> Vec<String> {
    vec![
        format!("  your mesh: a body of {:.4} mm² and {:.5} mm³", user_body.surface_area_mm2, user_body.volume_mm3),
        format!(
            "    {:<22}{:>7.4} mm{:>11.4} times the sphere of equal volume, {:.4} times the sphere of equal surface; {}",
            "",
            1e3 * user_body.stiffness_m,
            user_body.ratio_to_sphere_of_equal_volume,
            user_body.ratio_to_sphere_of_equal_surface,
            moved(user_body.displacement_5s_um)
        ),
    ]
}

fn meshes(summary: &ShapesSummary) -> Vec<String> {
    let built_in = || summary.bodies.iter().map(|body| body.mesh_3d);
    let unknowns = built_in().map(|mesh| mesh.unknowns);
    let (fewest, most) = (unknowns.clone().min().unwrap_or(0), unknowns.max().unwrap_or(0));
    let flattest = built_in().map(|mesh| mesh.smallest_scaled_jacobian).fold(1.0, f64::min);
    let slenderest = built_in().map(|mesh| mesh.largest_aspect).fold(1.0, f64::max);
    let mut lines = vec![format!(
        "3D meshes: {fewest} to {most} unknowns, scaled Jacobians from {flattest:.2}, aspect ratios of elements up to {slenderest:.0} : 1"
    )];
    lines.extend(summary.own_body.iter().map(|user_body| {
        format!(
            "your mesh: {} unknowns, scaled Jacobians from {:.2}, aspect ratios of elements up to {:.0} : 1",
            user_body.mesh.unknowns, user_body.mesh.smallest_scaled_jacobian, user_body.mesh.largest_aspect
        )
    }));
    lines
}

fn sweep(all: &[SweepSummary]) -> Vec<String> {
    let mut lines = vec![
        "Resistance relative to the sphere, for ellipsoid and cylinder (h: along the force, v: across it)".into(),
        format!(
            "  {:>8}{:>9}  {:^32}  {:^32}{:>10}",
            "aspect", "Poisson", "equal volume", "equal surface", "3D within"
        ),
        format!(
            "  {:>8}{:>9}{:>9}{:>8}{:>8}{:>8} {:>9}{:>8}{:>8}{:>8}",
            "", "", "ell. h", "ell. v", "cyl. h", "cyl. v", "ell. h", "ell. v", "cyl. h", "cyl. v"
        ),
    ];
    let mut seen = BTreeSet::new();
    for sweep_summary in all
        .iter()
        .filter(|sweep_summary| seen.insert((sweep_summary.aspect.to_bits(), sweep_summary.poisson_ratio.to_bits())))
    {
        let ratios: Vec<f64> = sweep_summary
            .bodies
            .iter()
            .filter(|body| body.orientation.is_some())
            .map(|body| body.ratio_to_sphere)
            .collect();
        let numbers: Vec<String> = ratios.iter().map(|ratio| format!("{ratio:>8.4}")).collect();
        let (volume, surface) = numbers.split_at(numbers.len() / 2);
        let within = sweep_summary.bodies.iter().map(|body| body.relative_difference_3d.abs()).fold(0.0, f64::max);
        lines.push(format!(
            "  {:>8.3}{:>9} {}  {}{within:>10.0e}",
            sweep_summary.aspect,
            sweep_summary.poisson_ratio,
            volume.concat(),
            surface.concat()
        ));
    }
    let forces: BTreeSet<u64> = all.iter().map(|sweep_summary| sweep_summary.force_un.to_bits()).collect();
    if forces.len() > 1 {
        lines.push("Displacement after 5 s, median in µm, at the first aspect and Poisson ratio".into());
        let first = (all[0].aspect, all[0].poisson_ratio);
        for sweep_summary in
            all.iter().filter(|sweep_summary| (sweep_summary.aspect, sweep_summary.poisson_ratio) == first)
        {
            let numbers: Vec<String> = sweep_summary
                .bodies
                .iter()
                .map(|body| format!("{} {:.0}", name(body), body.displacement_5s_um.median))
                .collect();
            let (volume, surface) = numbers.split_at(numbers.len() / 2);
            lines.push(format!("  ±{} µN, equal volume: {}", sweep_summary.force_un, volume.join("; ")));
            lines.push(format!("  ±{} µN, equal surface: {}", sweep_summary.force_un, surface.join("; ")));
        }
    }
    lines
}

fn verdict(claim: &Claim) -> String {
    serde_json::to_value(claim.verdict).ok().and_then(|value| value.as_str().map(String::from)).unwrap_or_default()
}

fn claim(entry: &Claim) -> String {
    format!("  {:<15}{} ({})", verdict(entry).to_uppercase(), entry.claim, entry.numbers)
}

/// Lines on the claims whose verdict depends on the aspect ratio or the Poisson ratio.
fn changing_claims(all: &[SweepSummary]) -> Vec<String> {
    let Some(first) = all.first() else { return Vec::new() };
    let mut lines = Vec::new();
    for (index, claim) in first.claims.iter().enumerate() {
        let same = |other: &&SweepSummary| other.claims[index].verdict != claim.verdict;
        let mut others: Vec<String> = all
            .iter()
            .filter(same)
            .map(|other| {
                let (aspect, ratio) = (other.aspect, other.poisson_ratio);
                format!("{} at aspect {aspect:.3} and Poisson ratio {ratio}", verdict(&other.claims[index]))
            })
            .collect();
        others.dedup();
        if !others.is_empty() {
            lines.push(format!("  for other values, {}: {}", claim.claim, others.join("; ")));
        }
    }
    lines
}

fn large_strains(large: &LargeStrains, hold_s: f64) -> Vec<String> {
    let mut lines = vec![
        "Bodies along the force at large strains, up to the time at which their bonded mesh becomes invalid:".into(),
        format!(
            "  {:<22}{:>8}{:>11}{:>14}{:>14}{:>8}{:>20}{:>8}{:>10}",
            "body",
            "aspect",
            "followed",
            "small strains",
            "Oldroyd-B",
            "error",
            format!("with mobility {}", large.other_mobility),
            "radii",
            "lengths"
        ),
    ];
    let mut rule = None;
    for large_shape in &large.bodies {
        if rule != Some(large_shape.size_rule) && large_shape.shape != BodyShape::Sphere {
            lines.push(format!("  at {}", large_shape.size_rule.title()));
            rule = Some(large_shape.size_rule);
        }
        lines.push(format!(
            "    {:<20}{:>8.2}{:>9.2} s{:>11.1} µm{:>+11.1} µm{:>8.1}{:>20}{:>8.1}{:>10.2}",
            large_shape.shape.name(),
            large_shape.aspect,
            large_shape.followed_s,
            large_shape.small_strains_um,
            large_shape.deviation_um,
            large_shape.error_um,
            large_shape.deviation_with_mobility_um.map_or("–".into(), |um| format!("{um:+.1} µm")),
            large_shape.radii_moved,
            large_shape.lengths_moved
        ));
    }
    if large.bodies.iter().any(|body| !body.is_whole) {
        lines.push(format!(
            "  At a slender tip or a sharp rim the bonded gel strains most and its mesh fails before {hold_s} s. Bodies are compared up to that time."
        ));
    }
    lines.extend(large.claims.iter().map(claim));
    lines
}

fn elastic(summary: &ShapesSummary) -> Vec<String> {
    let of = |ratio: f64, difference: f64| format!("{difference:.1e} at {ratio:e} ×");
    let differences: Vec<String> = summary
        .elastic_robot
        .iter()
        .map(|elastic_robot_result| {
            of(elastic_robot_result.modulus_ratio, elastic_robot_result.largest_relative_difference)
        })
        .collect();
    vec![format!(
        "Relative loss of stiffness of an elastic robot, bonded to the gel, against a rigid one: {} the gel's modulus (metals: 10¹⁰ ×)",
        differences.join(", ")
    )]
}

fn predictors(summary: &ShapesSummary) -> Vec<String> {
    let mut lines = vec![
        "Errors of simple predictions of a robot's resistance, from one length or from a spheroid of equal volume (root mean square, largest):"
            .into(),
    ];
    lines.extend(summary.predictors.iter().map(|predictor| {
        format!(
            "  {:<50}{:>6.1} %{:>8.1} % ({})",
            predictor.predictor,
            100.0 * predictor.rms_relative_error,
            100.0 * predictor.largest_relative_error,
            predictor.worst
        )
    }));
    lines
}
