//! Imported tetrahedra: what the errors are that the import's warnings speak of (physics §3.4, §3.5).

use std::path::Path;
use vitreo_uq::fe::Stiffness;
use vitreo_uq::fe::exact::SphereInContainer;
use vitreo_uq::fe::time::FullOrderModel;
use vitreo_uq::mesh::gmsh::read_gmsh;

/// Unknowns, and relative error of the stiffness at each Poisson ratio, of a mesh of the tests.
fn errors<const N: usize>(name: &str, poisson_ratios: [f64; N]) -> (usize, [f64; N]) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/gmsh").join(name);
    let mesh = read_gmsh(path, 1e-3).expect("a mesh of the tests").mesh;
    let stiffness = Stiffness::new(&mesh).expect("a sound mesh");
    let error = |poisson_ratio| {
        let model = FullOrderModel::new(&stiffness, poisson_ratio).expect("positive definite");
        let exact = SphereInContainer::new(poisson_ratio, 0.275e-3, 10e-3).stiffness_n_per_m(1.0);
        1.0 / (model.compliance_per_m() * exact) - 1.0
    };
    (stiffness.n_unknowns(), poisson_ratios.map(error))
}

#[test]
fn t() {
    for f in ["quarter_sphere_tet10.msh", "quarter_sphere_tet10_binary.msh", "quarter_sphere_tet4.msh"] {
        println!("{f} {:?}", errors(f, [0.0, 0.3, 0.48, 0.49, 0.499]));
    }
}
