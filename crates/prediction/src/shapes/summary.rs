//! Makes the document of a shape study, `vitreo-uq/shapes/1`.

use documents::shapes::{BodySummary, Displacement, MeshSummary, ShapesSummary, SweepSummary, UserBody};

use super::job::{BodyStiffness, OwnMesh, ShapesRequest, ShapesResult, StudyPoint};
use crate::ensemble::{BEYOND, beyond_record};
use documents::posterior::{Warning, WarningKind};
use documents::shapes::BodyShape;
use elements::fe::exact::SphereInContainer;
use elements::fe::quality::MeshQuality;
use figures::number::format_significant;
use record::Orientation;

fn mesh_summary(unknowns: usize, quality: &MeshQuality) -> MeshSummary {
    let MeshQuality { smallest_scaled_jacobian, largest_aspect, .. } = *quality;
    MeshSummary { unknowns, smallest_scaled_jacobian, largest_aspect }
}

/// Returns the document for the results of a study. `forces_n` holds the forces of the sweep in N; the study itself uses the first.
pub fn summarise(request: &ShapesRequest, found: &ShapesResult, forces_n: &[f64]) -> ShapesSummary {
    let outer_radius_m = 0.5 * request.vitreous.diameter_m;
    let of = |studied: &StudyPoint, force_n: f64| {
        // The gel is linear, so displacements are proportional to the force.
        let after_hold = found.after_hold.map(|x| x * force_n / request.force_n);
        let own_body = found.own_mesh.as_ref().zip(studied.own_stiffness_m);
        SweepSummary {
            aspect: studied.aspect,
            poisson_ratio: studied.poisson_ratio,
            force_un: 1e6 * force_n,
            bodies: studied
                .solved
                .iter()
                .map(|body_stiffness| body(body_stiffness, sphere_of(studied, body_stiffness), after_hold))
                .collect(),
            own_body: own_body
                .map(|(mesh, stiffness_m)| own(mesh, stiffness_m, studied.poisson_ratio, outer_radius_m, after_hold)),
            claims: studied.claims.clone(),
        }
    };
    let all: Vec<SweepSummary> =
        found.studied.iter().flat_map(|studied| forces_n.iter().map(move |force| of(studied, *force))).collect();
    let first = all[0].clone();
    let warnings = warnings(request, &all);
    ShapesSummary {
        poisson_ratio: first.poisson_ratio,
        vitreous_diameter_mm: 1e3 * request.vitreous.diameter_m,
        aspect: first.aspect,
        force_un: first.force_un,
        hold_s: request.hold_s,
        bodies: first.bodies,
        own_body: first.own_body,
        sweep: if all.len() > 1 { all } else { Vec::new() },
        claims: first.claims,
        elastic_robot: found.elastic.clone(),
        predictors: found.predictors.clone(),
        large_strains: found.large_strains.clone(),
        warnings,
    }
}

/// Warnings about bodies that would leave the gel, and about forces beyond that of the record that taught the law.
fn warnings(request: &ShapesRequest, all: &[SweepSummary]) -> Vec<Warning> {
    let mut list = Vec::new();
    let largest_n = all.iter().fold(0.0_f64, |most, point| most.max(1e-6 * point.force_un));
    let ratio = largest_n / request.gel.problem.experiment.scales().largest_force_n;
    if ratio > BEYOND {
        list.push(beyond_record("the largest force", ratio));
    }
    let bodies = all.iter().flat_map(|point| &point.bodies);
    let free_um =
        |body: &BodySummary| 500.0 * (1e3 * request.vitreous.diameter_m - body.length_mm.max(body.diameter_mm));
    let beyond: Vec<&BodySummary> = bodies.filter(|body| body.displacement_5s_um.q95 > free_um(body)).collect();
    let excess_um = |body: &BodySummary| body.displacement_5s_um.q95 - free_um(body);
    if let Some(worst) = beyond.iter().max_by(|a, b| excess_um(a).total_cmp(&excess_um(b))) {
        list.push(Warning {
            kind: WarningKind::ImpossiblePositions,
            text: format!(
                "{} of the displacements lead beyond the gel's outer surface, by up to {} µm",
                beyond.len(),
                format_significant(excess_um(worst), 4)
            ),
            advice: "give a smaller force".into(),
        });
    }
    list
}

/// Stiffness of the sphere under the size rule of the given body.
fn sphere_of<'a>(studied: &'a StudyPoint, body_stiffness: &BodyStiffness) -> &'a BodyStiffness {
    let is_sphere =
        |other: &&BodyStiffness| other.body.rule == body_stiffness.body.rule && other.body.shape == BodyShape::Sphere;
    studied.solved.iter().find(is_sphere).unwrap_or(&studied.solved[0])
}

fn displacement(force_per_pa: [f64; 3], stiffness_m: f64) -> Displacement {
    let [q05, median, q95] = force_per_pa.map(|x| 1e6 * x / stiffness_m);
    Displacement { median, q05, q95 }
}

fn body(body_stiffness: &BodyStiffness, sphere: &BodyStiffness, force_per_pa: [f64; 3]) -> BodySummary {
    let [length_m, diameter_m] = body_stiffness.body.sizes_m();
    let (surface, unit) = (body_stiffness.body.revolution(), sphere.body.revolution());
    BodySummary {
        shape: body_stiffness.body.shape,
        orientation: match (body_stiffness.body.shape, body_stiffness.body.orientation) {
            (BodyShape::Sphere, _) => None,
            (_, Orientation::Horizontal) => Some("horizontal".into()),
            (_, Orientation::Vertical) => Some("vertical".into()),
        },
        size_rule: body_stiffness.body.rule,
        length_mm: 1e3 * length_m,
        diameter_mm: 1e3 * diameter_m,
        stiffness_m: body_stiffness.stiffness_m,
        relative_error: body_stiffness.relative_error,
        relative_difference_3d: body_stiffness.stiffness_3d_m / body_stiffness.stiffness_m - 1.0,
        mesh_3d: mesh_summary(body_stiffness.unknowns, &body_stiffness.quality),
        ratio_to_sphere: body_stiffness.stiffness_m / sphere.stiffness_m,
        surface_ratio: surface.surface_area_m2() / unit.surface_area_m2(),
        volume_ratio: surface.volume_m3() / unit.volume_m3(),
        displacement_5s_um: displacement(force_per_pa, body_stiffness.stiffness_m),
    }
}

fn own(mesh: &OwnMesh, stiffness_m: f64, poisson_ratio: f64, outer_radius_m: f64, force_per_pa: [f64; 3]) -> UserBody {
    let [of_volume, of_surface] = mesh.size.equivalent_diameters_m().map(|diameter_m| {
        stiffness_m / SphereInContainer::new(poisson_ratio, 0.5 * diameter_m, outer_radius_m).stiffness_n_per_m(1.0)
    });
    UserBody {
        surface_area_mm2: 1e6 * mesh.size.surface_area_m2,
        volume_mm3: 1e9 * mesh.size.volume_m3,
        mesh: mesh_summary(mesh.unknowns, &mesh.quality),
        stiffness_m,
        ratio_to_sphere_of_equal_volume: of_volume,
        ratio_to_sphere_of_equal_surface: of_surface,
        displacement_5s_um: displacement(force_per_pa, stiffness_m),
    }
}
