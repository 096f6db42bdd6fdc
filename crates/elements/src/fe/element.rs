//! Element kernels: shape functions, pressure functions and the two parts of an element's unit
//! stiffness (physics §3.4).

use std::sync::OnceLock;

use nalgebra::{DMatrix, Matrix3, Vector3};

use super::quadrature;
use crate::mesh::{ElementKind, HEXAHEDRON27_REFERENCE_NODES};
use base::error::{Error, Result};

/// A type of element, defined on its reference cell.
pub trait Element: Sync {
    /// Number of nodes of one element.
    fn n_nodes(&self) -> usize;
    /// Writes the value of every node's shape function at a reference point.
    fn shape(&self, point: [f64; 3], shape: &mut [f64]);
    /// Writes the gradient, in reference coordinates, of every node's shape function at a reference
    /// point.
    fn shape_gradient(&self, point: [f64; 3], gradient: &mut [[f64; 3]]);
    /// Returns the values of the discontinuous pressure functions at a reference point. The list is
    /// empty if the element has displacements only.
    fn pressure(&self, point: [f64; 3]) -> Vec<f64>;
    /// Returns the quadrature points of the reference cell, each with its weight.
    fn quadrature(&self) -> Vec<([f64; 3], f64)>;
}

/// 27-node hexahedron with four discontinuous pressure functions: 1 and the reference coordinates
/// ξ, η and ζ.
struct Hexahedron27;
/// 10-node tetrahedron with displacements only (physics §3.5).
struct Tetrahedron10;
/// 4-node tetrahedron with displacements only. It *locks* (is far too stiff) at Poisson ratios near
/// 0.5 (physics §3.4).
struct Tetrahedron4;

/// Returns the element type that `kind` names.
pub(super) fn element_of(kind: ElementKind) -> &'static dyn Element {
    match kind {
        ElementKind::Hexahedron27 => &Hexahedron27,
        ElementKind::Tetrahedron10 => &Tetrahedron10,
        ElementKind::Tetrahedron4 => &Tetrahedron4,
    }
}

/// Value and derivative, at `x`, of the quadratic Lagrange polynomial that is 1 at `node` and 0 at
/// the two other points of {−1, 0, 1}.
fn lagrange(node: f64, x: f64) -> (f64, f64) {
    if node == 0.0 { (1.0 - x * x, -2.0 * x) } else { (0.5 * x * (x + node), x + 0.5 * node) }
}

impl Element for Hexahedron27 {
    fn n_nodes(&self) -> usize {
        27
    }
    fn shape(&self, point: [f64; 3], shape: &mut [f64]) {
        for (n, node) in shape.iter_mut().zip(&HEXAHEDRON27_REFERENCE_NODES) {
            *n = (0..3).map(|d| lagrange(node[d], point[d]).0).product();
        }
    }
    fn shape_gradient(&self, point: [f64; 3], gradient: &mut [[f64; 3]]) {
        for (g, node) in gradient.iter_mut().zip(&HEXAHEDRON27_REFERENCE_NODES) {
            let [(x, dx), (y, dy), (z, dz)] = std::array::from_fn(|d| lagrange(node[d], point[d]));
            *g = [dx * y * z, x * dy * z, x * y * dz];
        }
    }
    fn pressure(&self, point: [f64; 3]) -> Vec<f64> {
        vec![1.0, point[0], point[1], point[2]]
    }
    fn quadrature(&self) -> Vec<([f64; 3], f64)> {
        quadrature::hexahedron()
    }
}

/// Returns the four barycentric coordinates of a point in the unit tetrahedron, and their
/// gradients.
fn barycentric(p: [f64; 3]) -> ([f64; 4], [[f64; 3]; 4]) {
    (
        [1.0 - p[0] - p[1] - p[2], p[0], p[1], p[2]],
        [[-1.0, -1.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    )
}

/// The two corners of each edge of the 10-node tetrahedron, in the order in which VTK numbers the
/// edges.
const TETRAHEDRON_EDGES: [[usize; 2]; 6] = [[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]];

impl Element for Tetrahedron10 {
    fn n_nodes(&self) -> usize {
        10
    }
    fn shape(&self, point: [f64; 3], shape: &mut [f64]) {
        let (l, _) = barycentric(point);
        for a in 0..4 {
            shape[a] = l[a] * (2.0 * l[a] - 1.0);
        }
        for (e, [a, b]) in TETRAHEDRON_EDGES.into_iter().enumerate() {
            shape[4 + e] = 4.0 * l[a] * l[b];
        }
    }
    fn shape_gradient(&self, point: [f64; 3], gradient: &mut [[f64; 3]]) {
        let (l, dl) = barycentric(point);
        for a in 0..4 {
            gradient[a] = dl[a].map(|d| (4.0 * l[a] - 1.0) * d);
        }
        for (e, [a, b]) in TETRAHEDRON_EDGES.into_iter().enumerate() {
            gradient[4 + e] = std::array::from_fn(|d| 4.0 * (l[a] * dl[b][d] + l[b] * dl[a][d]));
        }
    }
    fn pressure(&self, _: [f64; 3]) -> Vec<f64> {
        Vec::new()
    }
    fn quadrature(&self) -> Vec<([f64; 3], f64)> {
        quadrature::tetrahedron()
    }
}

impl Element for Tetrahedron4 {
    fn n_nodes(&self) -> usize {
        4
    }
    fn shape(&self, point: [f64; 3], shape: &mut [f64]) {
        shape.copy_from_slice(&barycentric(point).0);
    }
    fn shape_gradient(&self, point: [f64; 3], gradient: &mut [[f64; 3]]) {
        gradient.copy_from_slice(&barycentric(point).1);
    }
    fn pressure(&self, _: [f64; 3]) -> Vec<f64> {
        Vec::new()
    }
    fn quadrature(&self) -> Vec<([f64; 3], f64)> {
        vec![([0.25; 3], 1.0 / 6.0)]
    }
}

/// An element type with shape and pressure functions tabulated at the quadrature points.
pub struct TabulatedElement {
    /// Number of nodes of one element.
    pub n_nodes: usize,
    points: Vec<TabulatedPoint>,
}

struct TabulatedPoint {
    weight: f64,
    shape: Vec<f64>,
    gradient: Vec<[f64; 3]>,
    pressure: Vec<f64>,
}

/// Values at one quadrature point of one element of a mesh.
pub struct PhysicalPoint<'a> {
    /// Quadrature weight × Jacobian determinant, in m³.
    pub volume_m3: f64,
    /// Value of every node's shape function.
    pub shape: &'a [f64],
    /// Gradient of every node's shape function with respect to position, in 1/m.
    pub gradient: &'a [[f64; 3]],
    /// Values of the pressure functions.
    pub pressure: &'a [f64],
}

/// Deviatoric and volumetric stiffness matrices (m) of one element, for unit moduli. Row and column
/// 3a + i belong to node a and component i.
pub struct ElementStiffness {
    /// Integral of dev ε : dev ε over the element, with dev ε the deviator of the strain.
    pub deviatoric: DMatrix<f64>,
    /// Integral of (Π div u)² over the element, with div u the volume strain. Π is the projection
    /// on the element's pressure functions, or the identity if there are none.
    pub volumetric: DMatrix<f64>,
}

impl TabulatedElement {
    /// Returns the tabulated element that `kind` names. Each kind is tabulated once per process.
    pub fn of(kind: ElementKind) -> &'static Self {
        static TABLES: [OnceLock<TabulatedElement>; 3] = [OnceLock::new(), OnceLock::new(), OnceLock::new()];
        TABLES[kind as usize].get_or_init(|| Self::new(element_of(kind)))
    }

    /// Tabulates the shape and pressure functions of an element type at its quadrature points.
    pub fn new(element: &dyn Element) -> Self {
        let n_nodes = element.n_nodes();
        let tabulate = |(point, weight)| {
            let (mut shape, mut gradient) = (vec![0.0; n_nodes], vec![[0.0; 3]; n_nodes]);
            element.shape(point, &mut shape);
            element.shape_gradient(point, &mut gradient);
            TabulatedPoint { weight, shape, gradient, pressure: element.pressure(point) }
        };
        Self { n_nodes, points: element.quadrature().into_iter().map(tabulate).collect() }
    }

    /// Iterates over the quadrature points. Each item holds the gradients of the shape functions in
    /// reference coordinates, and the values of the pressure functions.
    pub(super) fn reference_points(&self) -> impl Iterator<Item = (&[[f64; 3]], &[f64])> {
        self.points.iter().map(|point| (point.gradient.as_slice(), point.pressure.as_slice()))
    }

    /// Iterates over the Jacobians (m) at the quadrature points: derivatives of position with
    /// respect to reference coordinates. The element's nodes lie at `coordinates_m` (m).
    pub fn jacobians<'a>(&'a self, coordinates_m: &'a [[f64; 3]]) -> impl Iterator<Item = Matrix3<f64>> + 'a {
        self.points.iter().map(|point| {
            let mut jacobian = Matrix3::zeros();
            for (x, g) in coordinates_m.iter().zip(&point.gradient) {
                jacobian += Vector3::from(*x) * Vector3::from(*g).transpose();
            }
            jacobian
        })
    }

    /// Calls `visit` at every quadrature point of an element whose nodes lie at `coordinates_m`
    /// (m). Fails if the element is inverted.
    pub fn for_each_point(&self, coordinates_m: &[[f64; 3]], mut visit: impl FnMut(PhysicalPoint)) -> Result<()> {
        let mut gradient = vec![[0.0; 3]; self.n_nodes];
        for (point, jacobian) in self.points.iter().zip(self.jacobians(coordinates_m)) {
            let determinant = jacobian.determinant();
            let inverse_transpose =
                jacobian.try_inverse().filter(|_| determinant > 0.0).map(|inverse| inverse.transpose());
            let Some(inverse_transpose) = inverse_transpose else {
                let [x, y, z] = coordinates_m[0];
                return Err(Error::numerical(
                    format!(
                        "an element near ({x:.3e}, {y:.3e}, {z:.3e}) m is inverted or flat (Jacobian {determinant:.3e})"
                    ),
                    "refine the mesh where it is curved, or untangle it in the mesher",
                ));
            };
            for (physical, g) in gradient.iter_mut().zip(&point.gradient) {
                *physical = (inverse_transpose * Vector3::from(*g)).into();
            }
            visit(PhysicalPoint {
                volume_m3: point.weight * determinant,
                shape: &point.shape,
                gradient: &gradient,
                pressure: &point.pressure,
            });
        }
        Ok(())
    }

    /// Computes the deviatoric and volumetric stiffness matrices of an element whose nodes lie at
    /// `coordinates_m` (m).
    pub fn stiffness(&self, coordinates_m: &[[f64; 3]]) -> Result<ElementStiffness> {
        let n = self.n_nodes;
        let n_pressures = self.points[0].pressure.len();
        // Entries of both matrices are sums of entries of ∫ ∇φₐ ⊗ ∇φ_b, with φₐ the shape function
        // of node a ≤ b.
        let mut products = vec![[0.0_f64; 9]; n * (n + 1) / 2];
        let mut divergence = DMatrix::<f64>::zeros(3 * n, n_pressures);
        let mut pressure_mass = DMatrix::<f64>::zeros(n_pressures, n_pressures);
        self.for_each_point(coordinates_m, |point| {
            let mut pair = products.iter_mut();
            for (a, ga) in point.gradient.iter().enumerate() {
                let ga = ga.map(|g| g * point.volume_m3);
                for gb in &point.gradient[a..] {
                    let Some(entry) = pair.next() else { return };
                    for i in 0..3 {
                        for j in 0..3 {
                            entry[3 * i + j] += ga[i] * gb[j];
                        }
                    }
                }
                for (p, psi) in point.pressure.iter().enumerate() {
                    for i in 0..3 {
                        divergence[(3 * a + i, p)] += ga[i] * psi;
                    }
                }
            }
            for (p, psi_p) in point.pressure.iter().enumerate() {
                for (q, psi_q) in point.pressure.iter().enumerate() {
                    pressure_mass[(p, q)] += psi_p * psi_q * point.volume_m3;
                }
            }
        })?;
        let deviatoric = deviatoric(n, &products);
        let volumetric = if n_pressures == 0 {
            full_volumetric(n, &products)
        } else {
            let inverse = pressure_mass.try_inverse().ok_or_else(|| {
                Error::numerical(
                    "an element has a singular pressure mass matrix",
                    "untangle the mesh near that element",
                )
            })?;
            &divergence * inverse * divergence.transpose()
        };
        Ok(ElementStiffness { deviatoric, volumetric })
    }
}

/// Calls `visit` with (a, b, ∫ ∇φₐ ⊗ ∇φ_b) for every pair of nodes a ≤ b. φₐ is the shape function
/// of node a.
fn for_each_pair(n: usize, products: &[[f64; 9]], mut visit: impl FnMut(usize, usize, &[f64; 9])) {
    let mut pairs = products.iter();
    for a in 0..n {
        for b in a..n {
            if let Some(g) = pairs.next() {
                visit(a, b, g);
            }
        }
    }
}

/// Computes the deviatoric stiffness matrix of an element of `n` nodes. Its entries integrate dev
/// ε(φₐ eᵢ) : dev ε(φ_b eⱼ) = ½ (∇φₐ·∇φ_b δᵢⱼ + ∂ⱼφₐ ∂ᵢφ_b) − ⅓ ∂ᵢφₐ ∂ⱼφ_b. φₐ is the shape
/// function of node a, and eᵢ the unit vector of axis i.
fn deviatoric(n: usize, products: &[[f64; 9]]) -> DMatrix<f64> {
    let mut k = DMatrix::<f64>::zeros(3 * n, 3 * n);
    for_each_pair(n, products, |a, b, g| {
        let trace = g[0] + g[4] + g[8];
        for i in 0..3 {
            for j in 0..3 {
                let delta = if i == j { trace } else { 0.0 };
                let value = 0.5 * (delta + g[3 * j + i]) - g[3 * i + j] / 3.0;
                k[(3 * a + i, 3 * b + j)] = value;
                k[(3 * b + j, 3 * a + i)] = value;
            }
        }
    });
    k
}

/// Computes the volumetric stiffness matrix of an element of `n` nodes without pressure functions.
/// Its entries integrate the product of the divergences of two shape functions.
fn full_volumetric(n: usize, products: &[[f64; 9]]) -> DMatrix<f64> {
    let mut k = DMatrix::<f64>::zeros(3 * n, 3 * n);
    for_each_pair(n, products, |a, b, g| {
        for i in 0..3 {
            for j in 0..3 {
                k[(3 * a + i, 3 * b + j)] = g[3 * i + j];
                k[(3 * b + j, 3 * a + i)] = g[3 * i + j];
            }
        }
    });
    k
}

#[cfg(test)]
mod tests {
    use super::*;

    const ELEMENTS: [&dyn Element; 3] = [&Hexahedron27, &Tetrahedron10, &Tetrahedron4];

    #[test]
    fn shape_functions_are_a_partition_of_unity_with_the_right_gradients() {
        let p = [0.21, 0.13, 0.4];
        for element in ELEMENTS {
            let n = element.n_nodes();
            let (mut shape, mut gradient) = (vec![0.0; n], vec![[0.0; 3]; n]);
            element.shape(p, &mut shape);
            element.shape_gradient(p, &mut gradient);
            assert!((shape.iter().sum::<f64>() - 1.0).abs() < 1e-14);
            let h = 1e-6;
            for d in 0..3 {
                let (mut up, mut down) = (vec![0.0; n], vec![0.0; n]);
                let shift = |s: f64| std::array::from_fn(|i| p[i] + if i == d { s } else { 0.0 });
                element.shape(shift(h), &mut up);
                element.shape(shift(-h), &mut down);
                for ((up, down), gradient) in up.iter().zip(&down).zip(&gradient) {
                    assert!(((up - down) / (2.0 * h) - gradient[d]).abs() < 1e-8);
                }
            }
        }
    }

    /// Checks that rigid motions have no energy. A pure shear and a pure dilation must have their
    /// closed-form energies.
    #[test]
    fn stiffness_of_the_reference_hexahedron_has_the_closed_form_energies() {
        let element = TabulatedElement::of(ElementKind::Hexahedron27);
        let stiffness = element.stiffness(&HEXAHEDRON27_REFERENCE_NODES).expect("a cube is not inverted");
        let field = |f: &dyn Fn([f64; 3]) -> [f64; 3]| {
            nalgebra::DVector::from_iterator(81, HEXAHEDRON27_REFERENCE_NODES.iter().flat_map(|&x| f(x)))
        };
        let energy = |k: &DMatrix<f64>, u: &nalgebra::DVector<f64>| u.dot(&(k * u));
        let rotation = field(&|[x, y, _]| [-y, x, 0.0]);
        let shear = field(&|[_, y, _]| [y, 0.0, 0.0]);
        let dilation = field(&|x| x);
        assert!(energy(&stiffness.deviatoric, &rotation).abs() < 1e-12);
        assert!(energy(&stiffness.volumetric, &rotation).abs() < 1e-12);
        // ε_xy = ½ on a volume of 8: dev ε : dev ε = 2·¼, so that the energy is 4.
        assert!((energy(&stiffness.deviatoric, &shear) - 4.0).abs() < 1e-12);
        assert!(energy(&stiffness.deviatoric, &dilation).abs() < 1e-12);
        assert!((energy(&stiffness.volumetric, &dilation) - 72.0).abs() < 1e-11);
    }
}
