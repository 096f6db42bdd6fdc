use vitreo_uq::fe::{Stiffness, exact::SphereInContainer, time::FullOrderModel};
use vitreo_uq::mesh::QuarterBall;
#[test]
fn scan() {
    for (n, l) in [(3, 8), (3, 12), (4, 12), (4, 16), (5, 18)] {
        let mesh =
            QuarterBall { robot_radius_m: 0.275e-3, outer_radius_m: 10e-3, n_per_edge: n, n_layers: l }.mesh().unwrap();
        let t = std::time::Instant::now();
        let s = Stiffness::new(&mesh).unwrap();
        let mut line = format!("{n} {l}: {} unknowns asm {:.2}", s.n_unknowns(), t.elapsed().as_secs_f64());
        for nu in [0.3, 0.48, 0.499] {
            let m = FullOrderModel::new(&s, nu).unwrap();
            let tf = t.elapsed().as_secs_f64();
            let c = m.compliance_per_m();
            let k = SphereInContainer::new(nu, 0.275e-3, 10e-3).stiffness_n_per_m(1.0);
            line += &format!("  [{tf:.2}] {:.2e}", 1.0 / c / k - 1.0);
        }
        println!("{line}");
    }
}
