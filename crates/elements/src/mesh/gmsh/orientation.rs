//! Detection of inverted and folded tetrahedra by the sign of their Jacobian determinant.

/// Orientation of an element: the sign of its Jacobian determinant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Orientation {
    Positive,
    /// The element is inverted: its Jacobian determinant is negative.
    Negative,
    /// The element is flat, or folded over itself.
    Degenerate,
}

/// Reference coordinates at which the Jacobian is checked. They are corners, edge middles, and
/// inner points near the usual integration points.
const SAMPLES: [[f64; 3]; 15] = [
    [0.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [0.5, 0.0, 0.0],
    [0.5, 0.5, 0.0],
    [0.0, 0.5, 0.0],
    [0.0, 0.0, 0.5],
    [0.5, 0.0, 0.5],
    [0.0, 0.5, 0.5],
    [0.25, 0.25, 0.25],
    [0.14, 0.14, 0.14],
    [0.58, 0.14, 0.14],
    [0.14, 0.58, 0.14],
    [0.14, 0.14, 0.58],
];

/// Determines the orientation of a tetrahedron. `points` are its 4 or 10 nodes in the order of VTK.
pub(super) fn orientation(points: &[[f64; 3]]) -> Orientation {
    // The determinant is compared with the element's size, so that the unit of length does not
    // matter.
    let size = (1..4)
        .map(|k| (0..3).map(|axis| (points[k][axis] - points[0][axis]).powi(2)).sum::<f64>().sqrt())
        .fold(0.0, f64::max);
    let flat = 1e-9 * size.powi(3);
    let samples = if points.len() == 4 { &SAMPLES[..1] } else { &SAMPLES[..] };
    let (mut least, mut largest) = (f64::INFINITY, f64::NEG_INFINITY);
    for &sample in samples {
        let determinant = jacobian_determinant(points, sample);
        least = least.min(determinant);
        largest = largest.max(determinant);
    }
    if least > flat {
        Orientation::Positive
    } else if largest < -flat {
        Orientation::Negative
    } else {
        Orientation::Degenerate
    }
}

/// Renumbers an inverted element. It exchanges corners 0 and 1, and the edge nodes accordingly.
pub(super) fn turn(nodes: &mut [u32]) {
    nodes.swap(0, 1);
    if nodes.len() == 10 {
        // The exchange swaps edges 1–2 and 0–2, and edges 0–3 and 1–3.
        nodes.swap(5, 6);
        nodes.swap(7, 8);
    }
}

/// Determinant of the Jacobian ∂x/∂(ξ, η, ζ) at a reference point.
fn jacobian_determinant(points: &[[f64; 3]], [xi, eta, zeta]: [f64; 3]) -> f64 {
    // Barycentric coordinates λ₀ = 1 − ξ − η − ζ, λ₁ = ξ, λ₂ = η, λ₃ = ζ and their gradients.
    let lambda = [1.0 - xi - eta - zeta, xi, eta, zeta];
    let gradient = [[-1.0, -1.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let mut jacobian = [[0.0; 3]; 3];
    let mut add = |point: [f64; 3], shape_gradient: [f64; 3]| {
        for (row, coordinate) in jacobian.iter_mut().zip(point) {
            for (entry, derivative) in row.iter_mut().zip(shape_gradient) {
                *entry += coordinate * derivative;
            }
        }
    };
    if points.len() == 4 {
        for (point, gradient) in points.iter().zip(gradient) {
            add(*point, gradient);
        }
    } else {
        // Shape functions: λ(2λ − 1) at a corner, 4 λᵢ λⱼ on an edge.
        for k in 0..4 {
            add(points[k], gradient[k].map(|g| (4.0 * lambda[k] - 1.0) * g));
        }
        for (edge, [i, j]) in [[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]].into_iter().enumerate() {
            let derivative =
                std::array::from_fn(|axis| 4.0 * (lambda[i] * gradient[j][axis] + lambda[j] * gradient[i][axis]));
            add(points[4 + edge], derivative);
        }
    }
    let [a, b, c] = jacobian;
    a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.3, 1.0, 0.0], [0.1, 0.2, 1.5]];

    fn straight_tetrahedron10() -> Vec<[f64; 3]> {
        let mut points = CORNERS.to_vec();
        for [i, j] in [[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]] {
            points.push(std::array::from_fn(|axis| (CORNERS[i][axis] + CORNERS[j][axis]) / 2.0));
        }
        points
    }

    #[test]
    fn a_straight_element_has_six_times_its_volume_everywhere() {
        // The base area is 2 × 1 / 2 and the height 1.5. The volume is 0.5.
        for sample in SAMPLES {
            assert!((jacobian_determinant(&CORNERS, sample) - 3.0).abs() < 1e-12);
            assert!((jacobian_determinant(&straight_tetrahedron10(), sample) - 3.0).abs() < 1e-12);
        }
    }

    #[test]
    fn turning_changes_the_sign_and_turning_twice_changes_nothing() {
        let mut points = straight_tetrahedron10();
        points[4][1] -= 0.1;
        assert_eq!(orientation(&points), Orientation::Positive);
        let mut nodes: Vec<u32> = (0..10).collect();
        turn(&mut nodes);
        let turned: Vec<_> = nodes.iter().map(|&n| points[n as usize]).collect();
        assert_eq!(orientation(&turned), Orientation::Negative);
        turn(&mut nodes);
        assert!(nodes.into_iter().eq(0..10));
    }

    #[test]
    fn flat_and_folded_elements_are_degenerate() {
        let mut flat = CORNERS;
        flat[3][2] = 0.0;
        assert_eq!(orientation(&flat), Orientation::Degenerate);
        let mut folded = straight_tetrahedron10();
        // An edge node between a quarter point and the edge's end folds a quadratic edge.
        folded[4][0] = 1.9;
        assert_eq!(orientation(&folded), Orientation::Degenerate);
    }
}
