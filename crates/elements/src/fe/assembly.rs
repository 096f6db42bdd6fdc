//! Numbering of the displacement unknowns, and assembly of the two parts of the unit stiffness
//! matrix.

use faer::sparse::{SparseColMat, SparseColMatRef, SymbolicSparseColMat};
use rayon::prelude::*;

use super::element::{ElementStiffness, TabulatedElement};
use crate::mesh::Mesh;
use base::error::{Error, Result};

/// Number of element matrices that are computed in parallel and stored at a time, to limit the
/// memory.
const CHUNK: usize = 256;

const FIXED: u32 = u32::MAX;

/// Numbering of the unknown displacement components (physics §3.1). Components are fixed at zero on
/// the outer surface, and across symmetry planes. The robot's surface is rigid: it has one unknown,
/// its translation along x, which comes last.
#[derive(Debug, Clone)]
pub struct Unknowns {
    /// Index of each node's group: nodes that share their unknowns. All nodes of the robot form the
    /// last group; every other node is a group of its own.
    group: Vec<u32>,
    /// Index of the unknown of each component (x, y, z) of each group of nodes, or [`FIXED`].
    unknown: Vec<[u32; 3]>,
    count: usize,
    share: f64,
}

impl Unknowns {
    /// Numbers the displacement unknowns of a mesh.
    pub fn new(mesh: &Mesh) -> Result<Self> {
        let mut free = vec![[true; 3]; mesh.n_nodes()];
        for &node in &mesh.symmetry_y_nodes {
            free[node as usize][1] = false;
        }
        for &node in &mesh.symmetry_z_nodes {
            free[node as usize][2] = false;
        }
        for &node in &mesh.outer_nodes {
            free[node as usize] = [false; 3];
        }
        let mut on_robot = vec![false; mesh.n_nodes()];
        for &node in &mesh.robot_nodes {
            on_robot[node as usize] = true;
        }
        if mesh.robot_nodes.is_empty() || mesh.outer_nodes.is_empty() {
            return Err(Error::numerical(
                "the mesh has no robot surface or no outer surface",
                "name both surfaces in the mesh (physical groups `robot` and `outer`)",
            ));
        }
        let (mut group, mut unknown, mut count) = (vec![0; mesh.n_nodes()], Vec::new(), 0_u32);
        for node in 0..mesh.n_nodes() {
            if on_robot[node] {
                continue;
            }
            group[node] = unknown.len() as u32;
            unknown.push(free[node].map(|is_free| {
                if is_free {
                    count += 1;
                    count - 1
                } else {
                    FIXED
                }
            }));
        }
        for &node in &mesh.robot_nodes {
            group[node as usize] = unknown.len() as u32;
        }
        unknown.push([count, FIXED, FIXED]);
        Ok(Self { group, unknown, count: count as usize + 1, share: mesh.share() })
    }

    /// Number of displacement unknowns.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Fraction of the whole robot, and of the force on it, that the mesh contains
    /// ([`Mesh::share`]).
    pub fn share(&self) -> f64 {
        self.share
    }

    /// Number of nodes of the mesh.
    pub(super) fn n_nodes(&self) -> usize {
        self.group.len()
    }

    /// Index of the unknown that is the robot's translation along x.
    pub fn robot(&self) -> usize {
        self.count - 1
    }

    /// Elimination order of the unknowns for an elimination order of the nodes. The robot's
    /// translation is last.
    pub fn elimination_order(&self, node_order: &[usize]) -> Vec<usize> {
        let robot_group = self.unknown.len() - 1;
        let of_node = |&node: &usize| {
            let group = self.group[node] as usize;
            if group == robot_group { [FIXED; 3] } else { self.unknown[group] }
        };
        let interior = node_order.iter().flat_map(of_node).filter(|&u| u != FIXED).map(|u| u as usize);
        interior.chain([self.robot()]).collect()
    }

    /// Returns the displacement (m) of every node for a vector of unknowns (m).
    pub fn nodal_displacement(&self, values: &[f64]) -> Vec<[f64; 3]> {
        let component = |u: u32| if u == FIXED { 0.0 } else { values[u as usize] };
        self.group.iter().map(|&g| self.unknown[g as usize].map(component)).collect()
    }

    /// Adds a force (N) on a node to the right-hand side of the equilibrium equations. Force
    /// components along fixed displacements are dropped. Forces on the robot's nodes add up along
    /// x.
    pub fn add_nodal_force(&self, node: usize, force_n: [f64; 3], right_hand_side: &mut [f64]) {
        for (unknown, component) in self.unknown[self.group[node] as usize].into_iter().zip(force_n) {
            if unknown != FIXED {
                right_hand_side[unknown as usize] += component;
            }
        }
    }

    /// Index of the unknown of each component (x, y, z) of a node; `u32::MAX` if the component is
    /// fixed.
    pub(super) fn of_node(&self, node: u32) -> [u32; 3] {
        self.unknown[self.group[node as usize] as usize]
    }
}

/// Stiffness matrix at unit Young's modulus, stored as a deviatoric and a volumetric part. The
/// matrix is the sum of both, weighted by [`unit_moduli`]. Both have one sparsity pattern (upper
/// triangle, compressed columns).
#[derive(Debug, Clone)]
pub struct Assembly {
    /// Numbering of the displacement unknowns: the rows and columns of the matrices.
    pub unknowns: Unknowns,
    pattern: SymbolicSparseColMat<u32>,
    deviatoric: Vec<f64>,
    volumetric: Vec<f64>,
}

impl Assembly {
    /// Assembles the matrices of a mesh. Element matrices are computed in parallel and added in the
    /// order of the elements.
    pub fn new(mesh: &Mesh) -> Result<Self> {
        Self::assemble(mesh, |chunk, element| chunk.par_iter().map(element).collect())
    }

    /// Assembles on one thread. A test checks that parallel assembly gives equal bits.
    #[cfg(test)]
    fn serial(mesh: &Mesh) -> Result<Self> {
        Self::assemble(mesh, |chunk, element| chunk.iter().map(element).collect())
    }

    fn assemble(
        mesh: &Mesh,
        map: impl Fn(&[&[u32]], &(dyn Fn(&&[u32]) -> Result<ElementStiffness> + Sync)) -> Result<Vec<ElementStiffness>>,
    ) -> Result<Self> {
        let unknowns = Unknowns::new(mesh)?;
        let neighbours = group_neighbours(mesh, &unknowns);
        let pattern = Pattern::new(&unknowns, &neighbours);
        let mut deviatoric = vec![0.0; pattern.row_idx.len()];
        let mut volumetric = vec![0.0; pattern.row_idx.len()];
        let table = TabulatedElement::of(mesh.element_kind);
        let elements: Vec<&[u32]> = mesh.elements().collect();
        let compute = |nodes: &&[u32]| {
            let coordinates: Vec<_> = nodes.iter().map(|&n| mesh.node_coordinates_m[n as usize]).collect();
            table.stiffness(&coordinates)
        };
        for chunk in elements.chunks(CHUNK) {
            for (nodes, stiffness) in chunk.iter().zip(map(chunk, &compute)?) {
                pattern.scatter(&unknowns, &neighbours, nodes, &stiffness, &mut deviatoric, &mut volumetric);
            }
        }
        let n = unknowns.count();
        let pattern = SymbolicSparseColMat::new_checked(n, n, pattern.column_start, None, pattern.row_idx);
        Ok(Self { unknowns, pattern, deviatoric, volumetric })
    }

    /// Upper triangle of the stiffness matrix (m) for unit Young's modulus.
    pub fn unit_stiffness(&self, poisson_ratio: f64) -> SparseColMat<u32, f64> {
        let [two_mu, kappa] = unit_moduli(poisson_ratio);
        let combine = |(d, v): (&f64, &f64)| two_mu * d + kappa * v;
        let values = self.deviatoric.iter().zip(&self.volumetric).map(combine).collect();
        SparseColMat::new(self.pattern.clone(), values)
    }

    /// Upper triangle of the deviatoric part (m): the integral of dev ε : dev ε, with dev ε the
    /// deviator of the strain.
    pub fn deviatoric(&self) -> SparseColMatRef<'_, u32, f64> {
        SparseColMatRef::new(self.pattern.as_ref(), &self.deviatoric)
    }

    /// Upper triangle of the volumetric part (m): the integral of (Π div u)². div u is the volume
    /// strain, and Π the projection on the elements' pressure functions.
    pub fn volumetric(&self) -> SparseColMatRef<'_, u32, f64> {
        SparseColMatRef::new(self.pattern.as_ref(), &self.volumetric)
    }
}

/// Returns twice the shear modulus, and the bulk modulus, for unit Young's modulus.
pub fn unit_moduli(poisson_ratio: f64) -> [f64; 2] {
    [1.0 / (1.0 + poisson_ratio), 1.0 / (3.0 * (1.0 - 2.0 * poisson_ratio))]
}

/// Returns, for each group of nodes, the sorted groups that share an element with it and have no
/// larger index. The group itself is included.
fn group_neighbours(mesh: &Mesh, unknowns: &Unknowns) -> Vec<Vec<u32>> {
    let mut neighbours: Vec<Vec<u32>> = vec![Vec::new(); unknowns.unknown.len()];
    for nodes in mesh.elements() {
        let mut groups: Vec<u32> = nodes.iter().map(|&n| unknowns.group[n as usize]).collect();
        groups.sort_unstable();
        groups.dedup();
        for (i, &g) in groups.iter().enumerate() {
            neighbours[g as usize].extend_from_slice(&groups[..=i]);
        }
    }
    neighbours.par_iter_mut().for_each(|list| {
        list.sort_unstable();
        list.dedup();
    });
    neighbours
}

/// Sparsity pattern of the upper triangle in compressed columns. It also stores where the rows of
/// each group of nodes start in a column.
struct Pattern {
    column_start: Vec<u32>,
    row_idx: Vec<u32>,
    /// Number of rows in a column of node group g that precede the rows of its k-th neighbour
    /// group: `rows_before[g][k]`.
    rows_before: Vec<Vec<u32>>,
}

impl Pattern {
    fn new(unknowns: &Unknowns, neighbours: &[Vec<u32>]) -> Self {
        let (mut column_start, mut row_idx, mut rows_before) = (vec![0], Vec::new(), Vec::new());
        for (group, list) in neighbours.iter().enumerate() {
            let mut before = 0;
            rows_before.push(
                list.iter()
                    .map(|&g| {
                        let here = before;
                        before += unknowns.unknown[g as usize].iter().filter(|&&u| u != FIXED).count() as u32;
                        here
                    })
                    .collect(),
            );
            for column in unknowns.unknown[group].into_iter().filter(|&u| u != FIXED) {
                let rows = list.iter().flat_map(|&g| unknowns.unknown[g as usize]);
                row_idx.extend(rows.filter(|&row| row != FIXED && row <= column));
                column_start.push(row_idx.len() as u32);
            }
        }
        Self { column_start, row_idx, rows_before }
    }

    /// Adds the matrices of one element to the values of the upper triangle.
    fn scatter(
        &self,
        unknowns: &Unknowns,
        neighbours: &[Vec<u32>],
        nodes: &[u32],
        stiffness: &ElementStiffness,
        deviatoric: &mut [f64],
        volumetric: &mut [f64],
    ) {
        for (b, &column_node) in nodes.iter().enumerate() {
            let column_group = unknowns.group[column_node as usize] as usize;
            for (a, &row_node) in nodes.iter().enumerate() {
                let row_group = unknowns.group[row_node as usize];
                let Ok(slot) = neighbours[column_group].binary_search(&row_group) else { continue };
                let before = self.rows_before[column_group][slot] as usize;
                for (j, column) in unknowns.of_node(column_node).into_iter().enumerate() {
                    let mut place = before;
                    for (i, row) in unknowns.of_node(row_node).into_iter().enumerate() {
                        if row == FIXED || column == FIXED || row > column {
                            continue;
                        }
                        let at = self.column_start[column as usize] as usize + place;
                        deviatoric[at] += stiffness.deviatoric[(3 * a + i, 3 * b + j)];
                        volumetric[at] += stiffness.volumetric[(3 * a + i, 3 * b + j)];
                        place += 1;
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fe::factorisation::add_symmetric_product;
    use crate::mesh::QuarterBall;

    fn mesh() -> Mesh {
        // The mesh needs more than one chunk of elements, and the last chunk is incomplete.
        let ball = QuarterBall { robot_radius_m: 0.275e-3, outer_radius_m: 10e-3, n_per_edge: 3, n_layers: 5 };
        let mesh = ball.mesh().expect("the radii are in order");
        assert!(mesh.n_elements() > CHUNK && !mesh.n_elements().is_multiple_of(CHUNK));
        mesh
    }

    #[test]
    fn parallel_assembly_equals_serial_to_the_last_bit() {
        let mesh = mesh();
        let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<u64>>();
        let serial = Assembly::serial(&mesh).expect("no element is inverted");
        for threads in [1, 2, 5] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads can be had");
            let parallel = pool.install(|| Assembly::new(&mesh)).expect("no element is inverted");
            assert_eq!(bits(&parallel.deviatoric), bits(&serial.deviatoric), "{threads} threads");
            assert_eq!(bits(&parallel.volumetric), bits(&serial.volumetric), "{threads} threads");
            assert_eq!(parallel.pattern.row_idx(), serial.pattern.row_idx());
        }
    }

    /// Checks that the assembled matrix times u equals Pᵀ (Σ Kₑ) P u, with Kₑ the element matrices.
    /// P maps unknowns to node components. It is built only from the public maps between nodes and
    /// unknowns.
    #[test]
    fn the_matrix_is_the_sum_of_its_elements() {
        let mesh = mesh();
        let assembly = Assembly::new(&mesh).expect("no element is inverted");
        let unknowns = &assembly.unknowns;
        let u: Vec<f64> = (0..unknowns.count()).map(|i| (1.7 * i as f64).sin()).collect();
        let nodal = unknowns.nodal_displacement(&u);
        let table = TabulatedElement::of(mesh.element_kind);
        let mut expected = [vec![0.0; u.len()], vec![0.0; u.len()]];
        for nodes in mesh.elements() {
            let coordinates: Vec<_> = nodes.iter().map(|&n| mesh.node_coordinates_m[n as usize]).collect();
            let stiffness = table.stiffness(&coordinates).expect("no element is inverted");
            let local =
                nalgebra::DVector::from_iterator(3 * nodes.len(), nodes.iter().flat_map(|&n| nodal[n as usize]));
            for (matrix, sum) in [stiffness.deviatoric, stiffness.volumetric].into_iter().zip(&mut expected) {
                let force = matrix * &local;
                for (&node, f) in nodes.iter().zip(force.as_slice().chunks_exact(3)) {
                    unknowns.add_nodal_force(node as usize, [f[0], f[1], f[2]], sum);
                }
            }
        }
        for (matrix, expected) in [assembly.deviatoric(), assembly.volumetric()].into_iter().zip(expected) {
            let mut product = vec![0.0; u.len()];
            add_symmetric_product(matrix, &u, &mut product);
            let largest = expected.iter().fold(0.0_f64, |m, f| m.max(f.abs()));
            for (a, b) in product.iter().zip(&expected) {
                assert!((a - b).abs() < 1e-13 * largest, "{a} against {b}");
            }
        }
    }
}
