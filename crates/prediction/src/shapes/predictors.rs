//! Compares quantities that may predict a body's stiffness. The paper considers volume and surface area, and leaves other quantities open.
//!
//! Each predictor is a length that a sphere also has. The predicted stiffness of a body is the sphere's stiffness times the ratio of these lengths; nothing is
//! fitted. The predictors are compared for ellipsoids and cylinders of many aspect ratios, along and across the force.
//!
//! Spheroids that replace the body are further predictors. They include aspect ratio and orientation, and their stiffness has a closed form (physics §4.3,
//! §4.8). They are compared for cylinders only, because a spheroid would be replaced by itself.

use documents::shapes::PredictorAccuracy;
use std::f64::consts::PI;

use rayon::prelude::*;

use super::bodies::StudyBody;
use base::error::Result;
use documents::shapes::{BodyShape, SizeRule};
use elements::fe::meridional::{BodyOfRevolution, Direction, Resolution, solve};
use record::Orientation;

/// Aspect ratios for which the predictors are compared.
pub const SWEEP_ASPECTS: [f64; 9] = [0.2, 0.35, 0.6, 1.0, 1.7, 3.0, 5.0, 68.0 / 7.0, 15.0];

base::named_enum! {
    /// A length that may predict a body's stiffness.
    pub enum Predictor {
        /// Diameter of the sphere of equal volume.
        Volume = "volume",
        /// Diameter of the sphere of equal surface area, which the paper regards as the cause.
        Surface = "surface",
        /// Diameter of the disc whose area equals the body's area projected along the force.
        Projected = "projected area along the force",
        /// Largest extent of the body.
        Length = "length",
        /// One third of the `Projected` diameter plus two thirds of the `Surface` diameter, for pressure and shear drag (Leith 1987, Aerosol Sci. Technol. 6:153).
        Leith = "1/3 projected area + 2/3 surface (Leith 1987)",
        /// Mean caliper diameter: extent of the body, averaged over all directions.
        MeanCaliper = "mean caliper diameter",
    }
    /// Name of the predictor in words.
    pub fn title
}

impl Predictor {
    /// Length of a body that this predictor uses, in m.
    pub fn length_m(self, body: &StudyBody) -> f64 {
        let [along, across] = body.sizes_m();
        let disc = |area_m2: f64| (4.0 * area_m2 / PI).sqrt();
        match self {
            Self::Volume => (6.0 * body.revolution().volume_m3() / PI).cbrt(),
            Self::Surface => (body.revolution().surface_area_m2() / PI).sqrt(),
            Self::Projected => disc(match (body.orientation, body.revolution()) {
                (Orientation::Horizontal, _) => PI / 4.0 * across * across,
                (Orientation::Vertical, BodyOfRevolution::Spheroid { .. }) => PI / 4.0 * along * across,
                (Orientation::Vertical, BodyOfRevolution::Cylinder { .. }) => along * across,
            }),
            Self::Length => along.max(across),
            Self::Leith => (Self::Projected.length_m(body) + 2.0 * Self::Surface.length_m(body)) / 3.0,
            Self::MeanCaliper => mean_caliper_m(body.revolution()),
        }
    }
}

/// Distance in m between two parallel planes that touch the body, averaged over all directions.
fn mean_caliper_m(body: BodyOfRevolution) -> f64 {
    match body {
        // The extent of a spheroid with semi-axes a (along its axis) and b is 2 √(a²u² + b²(1 − u²)), where u is the cosine of the angle to the axis.
        BodyOfRevolution::Spheroid { semi_axis_along_m: a, semi_axis_across_m: b } => {
            let n = 2_000;
            let width = |i: usize| {
                let u = (i as f64 + 0.5) / n as f64;
                2.0 * (a * a * u * u + b * b * (1.0 - u * u)).sqrt()
            };
            (0..n).map(width).sum::<f64>() / n as f64
        }
        // The extent of a cylinder is L|u| + D √(1 − u²), with length L, diameter D and the cosine u. This is its mean over all directions.
        BodyOfRevolution::Cylinder { length_m, diameter_m } => 0.5 * length_m + 0.25 * PI * diameter_m,
    }
}

/// Compares the predictors with the computed stiffness of many bodies, divided by that of a sphere of equal volume. Returns their accuracy, best predictor
/// first.
///
/// # Errors
/// Errors of the meridional solver.
pub fn compare_predictors(
    sphere_diameter_m: f64,
    outer_radius_m: f64,
    poisson_ratio: f64,
) -> Result<Vec<PredictorAccuracy>> {
    let mut bodies = Vec::new();
    for aspect in SWEEP_ASPECTS {
        for shape in [BodyShape::Ellipsoid, BodyShape::Cylinder] {
            for orientation in [Orientation::Horizontal, Orientation::Vertical] {
                let rule = SizeRule::EqualVolume;
                bodies.push((aspect, StudyBody::new((shape, orientation), aspect, rule, sphere_diameter_m)));
            }
        }
    }
    let sphere =
        StudyBody::new((BodyShape::Sphere, Orientation::Horizontal), 1.0, SizeRule::EqualVolume, sphere_diameter_m);
    let coarse = Resolution { order: 6, rim_layers: 5, ..Resolution::default() };
    let stiffness_m = |body: BodyOfRevolution, direction: Direction| {
        solve(body, outer_radius_m, poisson_ratio, direction, coarse).map(|found| found.stiffness_m)
    };
    let of_sphere_m = stiffness_m(sphere.revolution(), sphere.direction())?;
    let ratio = |(_, body): &(f64, StudyBody)| Ok(stiffness_m(body.revolution(), body.direction())? / of_sphere_m);
    let ratios: Vec<f64> = bodies.par_iter().map(ratio).collect::<Result<_>>()?;
    let record = |predictor: Predictor| {
        let unit_m = predictor.length_m(&sphere);
        let errors: Vec<f64> = bodies
            .iter()
            .zip(&ratios)
            .map(|((_, body), ratio)| predictor.length_m(body) / unit_m / ratio - 1.0)
            .collect();
        record_of(predictor.title(), &errors, &bodies)
    };
    let mut records: Vec<PredictorAccuracy> = Predictor::ALL.into_iter().map(record).collect();
    let cylinders = || bodies.iter().zip(&ratios).filter(|((_, body), _)| body.shape == BodyShape::Cylinder);
    let names = cylinders().map(|((aspect, body), _)| (*aspect, *body)).collect::<Vec<_>>();
    for (title, scales) in EQUIVALENT_SPHEROIDS {
        let of_twin = |((_, body), ratio): (&(f64, StudyBody), &f64)| {
            let of_twin_m = stiffness_m(equivalent_spheroid(body, scales), body.direction())?;
            Ok(of_twin_m / of_sphere_m / ratio - 1.0)
        };
        let errors: Vec<f64> = cylinders().map(of_twin).collect::<Result<_>>()?;
        records.push(record_of(title, &errors, &names));
    }
    records.sort_by(|a, b| a.rms_relative_error.total_cmp(&b.rms_relative_error));
    Ok(records)
}

fn record_of(title: &str, errors: &[f64], bodies: &[(f64, StudyBody)]) -> PredictorAccuracy {
    let squares = errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64;
    let worst = (0..errors.len()).max_by(|a, b| errors[*a].abs().total_cmp(&errors[*b].abs())).unwrap_or(0);
    PredictorAccuracy {
        predictor: title.into(),
        rms_relative_error: squares.sqrt(),
        largest_relative_error: errors[worst],
        worst: format!("{} of aspect {:.2}", bodies[worst].1.label(), bodies[worst].0),
    }
}

/// Spheroids that replace a cylinder: name, and ratios of the spheroid's axes to the cylinder's length and diameter. For equal volume both ratios are the cube
/// root of 3/2. For equal second moments, length²/12 and diameter²/16 of the cylinder equal a fifth of the spheroid's squared semi-axes.
const EQUIVALENT_SPHEROIDS: [(&str, [f64; 2]); 2] = [
    ("spheroid of equal volume and aspect (cylinders)", [1.144_714_242_553_332, 1.144_714_242_553_332]),
    ("spheroid of equal second moments (cylinders)", [1.290_994_448_735_805_6, 1.118_033_988_749_895]),
];

fn equivalent_spheroid(body: &StudyBody, [of_length, of_diameter]: [f64; 2]) -> BodyOfRevolution {
    let [length_m, diameter_m] = body.sizes_m();
    BodyOfRevolution::Spheroid {
        semi_axis_along_m: 0.5 * of_length * length_m,
        semi_axis_across_m: 0.5 * of_diameter * diameter_m,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// For a sphere, the length of every predictor is the diameter.
    #[test]
    fn lengths_of_a_sphere_are_its_diameter() {
        let (diameter_m, orientation) = (0.55e-3, Orientation::Vertical);
        let body = StudyBody::new((BodyShape::Sphere, orientation), 1.0, SizeRule::EqualVolume, diameter_m);
        for predictor in Predictor::ALL {
            assert!((predictor.length_m(&body) / diameter_m - 1.0).abs() < 1e-6, "{predictor:?}");
        }
    }

    /// Mean caliper diameters agree with closed forms. For a cylinder the closed form is length/2 + π diameter/4. A spheroid is tested in the limit of a
    /// needle, whose mean caliper diameter is half its length.
    #[test]
    fn mean_caliper_diameters() {
        let cylinder = BodyOfRevolution::Cylinder { length_m: 3.0, diameter_m: 2.0 };
        assert!((mean_caliper_m(cylinder) - (1.5 + 0.5 * PI)).abs() < 1e-14);
        let needle = BodyOfRevolution::Spheroid { semi_axis_along_m: 1.0, semi_axis_across_m: 1e-9 };
        assert!((mean_caliper_m(needle) - 1.0).abs() < 1e-6);
    }

    /// The spheroids that replace a cylinder have its volume, or its second moments.
    #[test]
    fn spheroids_in_a_cylinders_place() {
        let body = StudyBody::new((BodyShape::Cylinder, Orientation::Horizontal), 7.5, SizeRule::EqualVolume, 0.55e-3);
        let ([length_m, diameter_m], revolution) = (body.sizes_m(), body.revolution());
        let of_volume = equivalent_spheroid(&body, EQUIVALENT_SPHEROIDS[0].1);
        assert!((of_volume.volume_m3() / revolution.volume_m3() - 1.0).abs() < 1e-14);
        let BodyOfRevolution::Spheroid { semi_axis_along_m: a, semi_axis_across_m: b } =
            equivalent_spheroid(&body, EQUIVALENT_SPHEROIDS[1].1)
        else {
            panic!("not a spheroid")
        };
        assert!((a * a / 5.0 / (length_m * length_m / 12.0) - 1.0).abs() < 1e-14);
        assert!((b * b / 5.0 / (diameter_m * diameter_m / 16.0) - 1.0).abs() < 1e-14);
    }
}
