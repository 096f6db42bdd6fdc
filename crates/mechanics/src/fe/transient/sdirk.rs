//! A singly diagonally implicit Runge–Kutta method of order four with five stages: E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, §IV.6,
//! table 6.5, doi:10.1007/978-3-642-05221-7. L-stable, and its last stage is the step's end.

/// Number of stages.
pub(super) const N_STAGES: usize = 5;

/// γ, the diagonal of A.
pub(super) const DIAGONAL: f64 = 0.25;

/// A below its diagonal.
pub(super) const LOWER: [&[f64]; N_STAGES] = [
    &[],
    &[1.0 / 2.0],
    &[17.0 / 50.0, -1.0 / 25.0],
    &[371.0 / 1360.0, -137.0 / 2720.0, 15.0 / 544.0],
    &[25.0 / 24.0, -49.0 / 48.0, 125.0 / 16.0, -85.0 / 12.0],
];

/// `result` = `start` + Δt Σ aᵢⱼ `rates`ⱼ over the stages before `stage`.
pub(super) fn predict(stage: usize, step_s: f64, start: &[f64], rates: &[Vec<f64>], result: &mut [f64]) {
    result.copy_from_slice(start);
    for (a, rates) in LOWER[stage].iter().zip(rates) {
        for (value, rate) in result.iter_mut().zip(rates) {
            *value += a * step_s * rate;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{SMatrix, SVector};

    fn coefficients() -> (SMatrix<f64, 5, 5>, SVector<f64, 5>, SVector<f64, 5>) {
        let a = SMatrix::<f64, 5, 5>::from_fn(|i, j| match i.cmp(&j) {
            std::cmp::Ordering::Greater => LOWER[i][j],
            std::cmp::Ordering::Equal => DIAGONAL,
            std::cmp::Ordering::Less => 0.0,
        });
        (a, a.row(4).transpose(), a * SVector::repeat(1.0))
    }

    /// The eight order conditions up to four.
    #[test]
    fn the_order_is_four() {
        let (a, b, c) = coefficients();
        let power = |n: i32| c.map(|c| c.powi(n));
        let conditions = [
            (b.sum(), 1.0),
            (b.dot(&c), 0.5),
            (b.dot(&power(2)), 1.0 / 3.0),
            (b.dot(&(a * c)), 1.0 / 6.0),
            (b.dot(&power(3)), 0.25),
            (b.dot(&c.component_mul(&(a * c))), 0.125),
            (b.dot(&(a * power(2))), 1.0 / 12.0),
            (b.dot(&(a * a * c)), 1.0 / 24.0),
        ];
        for (found, exact) in conditions {
            assert!((found - exact).abs() < 1e-14, "{found} {exact}");
        }
    }

    /// R(z) = 1 + z bᵀ(I − zA)⁻¹1 is e^z to z⁵, at most 1 on the imaginary axis and 0 at −∞.
    #[test]
    fn the_method_is_l_stable() {
        let (a, b, _) = coefficients();
        let on_axis = |y: f64| {
            // (I − iyA)(p + iq) = 1 in real numbers.
            let mut system = SMatrix::<f64, 10, 10>::identity();
            system.fixed_view_mut::<5, 5>(0, 5).copy_from(&(a * y));
            system.fixed_view_mut::<5, 5>(5, 0).copy_from(&(a * -y));
            let ones = SVector::<f64, 10>::from_fn(|i, _| if i < 5 { 1.0 } else { 0.0 });
            let solved = system.lu().solve(&ones).expect("the stages have no eigenvalue there");
            let (p, q) = (b.dot(&solved.fixed_rows::<5>(0)), b.dot(&solved.fixed_rows::<5>(5)));
            (1.0 - y * q).hypot(y * p)
        };
        for k in -60..=60 {
            assert!(on_axis(10.0_f64.powf(0.1 * f64::from(k))) <= 1.0 + 1e-14, "{k}");
        }
        let real = |z: f64| {
            let inverse = (SMatrix::<f64, 5, 5>::identity() - a * z).try_inverse().expect("z is not a pole");
            1.0 + z * b.dot(&(inverse * SVector::repeat(1.0)))
        };
        assert!(real(-1e9).abs() < 1e-8);
        let ratio = (real(-0.2) - (-0.2_f64).exp()) / (real(-0.1) - (-0.1_f64).exp());
        assert!((ratio.log2() - 5.0).abs() < 0.2, "{ratio}");
    }
}
