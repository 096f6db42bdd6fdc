//! Tests of forces that are straight lines between rows. They compare the closed forms with an independent algorithm that steps
//! the stages' differential equations.

use super::Response;
use super::tests::{assert_close, lethersich, rich_law};
use base::number::Dual;
use elements::fe::stepping::Resolution;
use elements::fe::stepping::run::strains;
use laws::rheology::Element;
use laws::stages::Stages;
use record::{Force, ForceRule};

const COMPLIANCE_PER_M: f64 = 549.0;

/// Returns times (s) and forces (N) at irregular rows. The force starts with a jump, oscillates with a row at each zero crossing,
/// and is constant at the end.
fn record() -> (Vec<f64>, Vec<f64>) {
    let (mut time_s, mut force_n) = (Vec::new(), Vec::new());
    for i in 0..90 {
        let t = 0.1 * f64::from(i) + if i % 4 == 1 { 0.03 } else { 0.0 };
        let to_n = if i < 70 { 3e-6 * (0.6 + 2.3 * t).cos() } else { 2e-6 };
        if let (Some(&from_s), Some(&from_n)) = (time_s.last(), force_n.last())
            && from_n * to_n < 0.0
        {
            time_s.push(from_s + (t - from_s) * from_n / (from_n - to_n));
            force_n.push(0.0);
        }
        time_s.push(t);
        force_n.push(to_n);
    }
    (time_s, force_n)
}

fn number(value: f64) -> Dual {
    Dual::constant(value)
}

/// Checks every load and mechanics feature alone, and all features together. The stepping has a relative error of 2e-8. Each sum of
/// exponentials for a springpot has an error of 1e-6 of a step response.
#[test]
fn equal_the_stepping_of_the_definition() {
    let (time_s, force_n) = record();
    let force = Force { at_rows_n: &force_n, rule: ForceRule::Linear };
    let response = Response::new(&time_s, force, time_s.len());
    for choice in 0..64_usize {
        let on = |bit: usize, value: f64| number(if choice & (1 << bit) != 0 { value } else { 0.0 });
        let mut stages = if choice & 32 != 0 { rich_law() } else { lethersich() };
        stages.load.delay_s = on(0, 0.137);
        stages.load.lag_time_s = on(1, 0.09);
        stages.softening_rate_per_s = on(2, 0.12);
        stages.load.gradient_per_m = on(3, -350.0);
        if choice & 16 != 0 {
            (stages.load.positive_factor, stages.load.offset_n) = (number(1.1), number(3e-7));
        }
        assert_equal(&stages, &response, &time_s, force, 1e-7, &format!("{choice:06b}"));
    }
    let mut springpot = lethersich();
    springpot.law.push(Element::Springpot { modulus_pa: number(9.0), time_s: number(0.4), order: number(0.45) });
    assert_equal(&springpot, &response, &time_s, force, 3e-6, "a springpot");
    let mut fractional = lethersich();
    let damping = Element::Springpot { modulus_pa: number(3.5), time_s: number(0.4), order: number(0.7) };
    fractional.law[0] = Element::Parallel(vec![Element::Spring { modulus_pa: number(3.5) }, damping]);
    assert_equal(&fractional, &response, &time_s, force, 3e-6, "a springpot in parallel");
    let held = Response::new(&time_s, &force_n, time_s.len());
    assert_equal(&springpot, &held, &time_s, (&force_n).into(), 3e-6, "a springpot under forces that hold");
}

fn assert_equal(stages: &Stages, response: &Response, time_s: &[f64], force: Force<'_>, tolerance: f64, what: &str) {
    let strains = strains(COMPLIANCE_PER_M, stages, time_s, force, Resolution::default()).expect("a sound model");
    let stepped: Vec<f64> = strains.iter().map(|q| COMPLIANCE_PER_M * q).collect();
    let found = response.trajectory_m(stages, COMPLIANCE_PER_M).expect("a sound model");
    assert_close(&found, &stepped, tolerance, what);
}

/// Checks that steep lines approximate steps. Every row of a force with holds occurs twice, the second time slightly later.
#[test]
fn steep_lines_are_steps() {
    let mut stages = rich_law();
    stages.load.lag_time_s = number(0.05);
    let (mut time_s, mut force_n) = (Vec::new(), Vec::new());
    for (i, level) in [4e-6, -4e-6, 0.0, 2e-6].into_iter().enumerate() {
        for row in 0..10 {
            time_s.push(i as f64 + 0.1 * f64::from(row) + if row == 0 && i > 0 { 1e-9 } else { 0.0 });
            force_n.push(level);
        }
        time_s.push((i + 1) as f64);
        force_n.push(level);
    }
    let respond = |rule: ForceRule| {
        let force = Force { at_rows_n: &force_n, rule };
        Response::new(&time_s, force, time_s.len()).trajectory_m(&stages, COMPLIANCE_PER_M).expect("sound")
    };
    assert_close(&respond(ForceRule::Linear), &respond(ForceRule::Hold), 1e-7, "steps");
}
