//! Time-stepping methods: singly diagonally implicit Runge–Kutta. Every stage is a step of implicit
//! Euler. The last stage is at the step's end, so that the force balance holds there.
//!
//! [`Scheme::Fourth`] has order 4 and five stages, is L-stable and has the diagonal coefficient ¼.
//! Source: E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, §IV.6, Table 6.5,
//! doi:10.1007/978-3-642-05221-7. [`Scheme::Euler`] has one stage. It serves uses that need the
//! shapes of fields but not accurate times.

/// Runge–Kutta method of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Scheme {
    /// Fourth-order method with five stages.
    #[default]
    Fourth,
    /// Implicit Euler method of order 1 with one stage. It costs a fifth of [`Self::Fourth`].
    Euler,
}

/// Coefficients of a Runge–Kutta method.
#[derive(Debug, Clone, Copy)]
pub struct Tableau {
    /// Diagonal coefficient: every stage is an implicit Euler step of this fraction of the step's
    /// length.
    pub diagonal: f64,
    /// Time of each stage, as a fraction of the step.
    pub nodes: &'static [f64],
    /// Coefficients below the diagonal. Stage i starts from the state at the step's start plus the
    /// step's length times Σⱼ `matrix[i][j]` × the rate of the earlier stage j.
    pub matrix: &'static [&'static [f64]],
}

impl Scheme {
    /// Returns the coefficients of the method.
    pub fn tableau(self) -> Tableau {
        match self {
            Self::Fourth => FOURTH,
            Self::Euler => Tableau { diagonal: 1.0, nodes: &[1.0], matrix: &[&[]] },
        }
    }
}

pub const FOURTH: Tableau = Tableau {
    diagonal: 0.25,
    nodes: &[0.25, 0.75, 0.55, 0.5, 1.0],
    matrix: &[
        &[],
        &[0.5],
        &[17.0 / 50.0, -1.0 / 25.0],
        &[371.0 / 1360.0, -137.0 / 2720.0, 15.0 / 544.0],
        &[25.0 / 24.0, -49.0 / 48.0, 125.0 / 16.0, -85.0 / 12.0],
    ],
};

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{SMatrix, SVector};

    const N_STAGES: usize = 5;

    fn entry(i: usize, j: usize) -> f64 {
        if i == j { FOURTH.diagonal } else { FOURTH.matrix[i][j] }
    }

    fn apply(v: [f64; N_STAGES]) -> [f64; N_STAGES] {
        std::array::from_fn(|i| (0..=i).map(|j| entry(i, j) * v[j]).sum())
    }

    fn product(a: [f64; N_STAGES], b: [f64; N_STAGES]) -> [f64; N_STAGES] {
        std::array::from_fn(|i| a[i] * b[i])
    }

    /// Checks all eight conditions of order 4. The method's weights equal the last row of its
    /// matrix.
    #[test]
    fn the_order_conditions_hold() {
        let c = apply([1.0; N_STAGES]);
        let weighed = |v: [f64; N_STAGES]| apply(v)[N_STAGES - 1];
        assert!(c.iter().zip(FOURTH.nodes).all(|(a, b)| (a - b).abs() < 1e-14));
        let (ac, cc) = (apply(c), product(c, c));
        for (found, exact) in [
            (weighed([1.0; N_STAGES]), 1.0),
            (weighed(c), 1.0 / 2.0),
            (weighed(cc), 1.0 / 3.0),
            (weighed(ac), 1.0 / 6.0),
            (weighed(product(cc, c)), 1.0 / 4.0),
            (weighed(product(c, ac)), 1.0 / 8.0),
            (weighed(apply(cc)), 1.0 / 12.0),
            (weighed(apply(ac)), 1.0 / 24.0),
        ] {
            assert!((found - exact).abs() < 1e-14, "{found} {exact}");
        }
    }

    /// Checks the stability function R(z) = 1 + z bᵀ(I − zA)⁻¹1, with the method's matrix A and
    /// weights b. It agrees with e^z to z⁵, is at most 1 on the imaginary axis, and is 0 at −∞.
    #[test]
    fn the_method_is_l_stable() {
        let a = SMatrix::<f64, N_STAGES, N_STAGES>::from_fn(|i, j| if j <= i { entry(i, j) } else { 0.0 });
        let b = a.row(N_STAGES - 1).transpose();
        let on_axis = |y: f64| {
            // (I − iyA)(p + iq) = 1, written as a real system for p and q.
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
