//! Displacement components of nodes as combinations of unknowns. On the robot's surface, nodes are
//! tied to the robot or slip along it.

use nalgebra::Vector3;

use crate::fe::surface::robot_normals;
use crate::mesh::Mesh;
use base::error::{Error, Result};

/// Cosine of the angle between two normals at a node above which they count as equal. The faces
/// then belong to a smooth surface.
const SAME_NORMAL: f64 = 0.94;
/// Length below which a direction counts as zero after subtraction of its components along other
/// directions.
const ZERO_DIRECTION_LENGTH: f64 = 1e-6;

/// Displacement of every node as a combination of unknowns. The last unknown is the robot's
/// translation along x (physics §3.1).
#[derive(Debug, Clone)]
pub struct DegreesOfFreedom {
    /// Index in `terms` of the first term of each displacement component: `start[3·node + i]` for
    /// component i of a node. The next entry is the end of the component's terms.
    start: Vec<u32>,
    terms: Vec<(u32, f64)>,
    count: usize,
    /// Index of the first slip unknown. All unknowns from here up to the robot's are slips.
    first_slip: usize,
    share: f64,
}

impl DegreesOfFreedom {
    /// Builds degrees of freedom in which the gel on the robot's surface moves with the robot. The
    /// outer surface is fixed.
    ///
    /// # Errors
    /// [`Error::Numerical`] for a mesh without a robot or an outer surface.
    pub fn tied(mesh: &Mesh) -> Result<Self> {
        Self::new(mesh, |_| Vec::new(), false)
    }

    /// Builds degrees of freedom in which the gel on the robot's surface moves with the robot and
    /// the outer surface is free.
    ///
    /// # Errors
    /// Those of [`Self::tied`].
    pub fn with_free_outer_surface(mesh: &Mesh) -> Result<Self> {
        Self::new(mesh, |_| Vec::new(), true)
    }

    /// Builds degrees of freedom in which the gel moves with the robot along the surface's normal
    /// and may slip along the surface.
    ///
    /// At an edge between faces of different directions, the gel slips only along their common
    /// direction.
    ///
    /// # Errors
    /// Those of [`Self::tied`].
    pub fn slipping(mesh: &Mesh) -> Result<Self> {
        let normals = distinct_normals(mesh);
        Self::new(
            mesh,
            |node| {
                let mut closed: Vec<Vector3<f64>> = Vec::new();
                let on = |nodes: &[u32]| nodes.binary_search(&(node as u32)).is_ok();
                let planes = [(on(&mesh.symmetry_y_nodes), Vector3::y()), (on(&mesh.symmetry_z_nodes), Vector3::z())];
                let of_planes = planes.into_iter().filter(|(is_on, _)| *is_on).map(|(_, normal)| normal);
                for normal in of_planes.chain(normals[node].iter().copied()) {
                    closed.extend(left_of(normal, &closed));
                }
                let mut open: Vec<Vector3<f64>> = Vec::new();
                for axis in [Vector3::y(), Vector3::z(), Vector3::x()] {
                    let known: Vec<Vector3<f64>> = closed.iter().chain(&open).copied().collect();
                    open.extend(left_of(axis, &known));
                }
                open
            },
            false,
        )
    }

    /// Numbers the unknowns. `slips` returns the slip directions of a node on the robot's surface.
    fn new(mesh: &Mesh, slips: impl Fn(usize) -> Vec<Vector3<f64>>, is_outer_free: bool) -> Result<Self> {
        if mesh.robot_nodes.is_empty() || mesh.outer_nodes.is_empty() {
            return Err(Error::numerical(
                "the mesh has no robot surface or no outer surface",
                "name both surfaces in the mesh (physical groups `robot` and `outer`)",
            ));
        }
        let on = |nodes: &[u32], node: usize| nodes.binary_search(&(node as u32)).is_ok();
        let mut combinations: Vec<[Vec<(u32, f64)>; 3]> = vec![Default::default(); mesh.n_nodes()];
        let mut count = 0_u32;
        for (node, of_node) in combinations.iter_mut().enumerate() {
            if (on(&mesh.outer_nodes, node) && !is_outer_free) || on(&mesh.robot_nodes, node) {
                continue;
            }
            let fixed = [false, on(&mesh.symmetry_y_nodes, node), on(&mesh.symmetry_z_nodes, node)];
            for (component, is_fixed) in of_node.iter_mut().zip(fixed) {
                if !is_fixed {
                    component.push((count, 1.0));
                    count += 1;
                }
            }
        }
        let first_slip = count as usize;
        for &node in &mesh.robot_nodes {
            for direction in slips(node as usize) {
                for (component, share) in combinations[node as usize].iter_mut().zip(direction.iter()) {
                    if *share != 0.0 {
                        component.push((count, *share));
                    }
                }
                count += 1;
            }
        }
        let robot_nodes = mesh.robot_nodes.iter().map(|&node| node as usize);
        Ok(Self::of_combinations(combinations, robot_nodes, [first_slip, count as usize], mesh.share()))
    }

    /// Degrees of freedom of `count` unknowns that belong to no nodes. The last unknown is the
    /// robot's translation.
    pub(super) fn without_nodes(count: usize, share: f64) -> Self {
        Self { start: vec![0], terms: Vec::new(), count, first_slip: count, share }
    }

    /// Builds degrees of freedom from the combination of unknowns in each component of every node.
    /// The given combinations exclude the robot's translation. This function adds it to the first
    /// component of the robot's nodes. Unknowns from `first_slip` up to the robot's are slips.
    pub(in crate::fe) fn of_combinations(
        mut combinations: Vec<[Vec<(u32, f64)>; 3]>,
        robot_nodes: impl Iterator<Item = usize>,
        [first_slip, count]: [usize; 2],
        share: f64,
    ) -> Self {
        for node in robot_nodes {
            combinations[node][0].push((count as u32, 1.0));
        }
        let (mut start, mut terms) = (vec![0], Vec::new());
        for component in combinations.into_iter().flatten() {
            terms.extend(component);
            start.push(terms.len() as u32);
        }
        Self { start, terms, count: count + 1, first_slip, share }
    }

    /// Number of unknowns: displacement components, slips and the robot's translation.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Fraction of the whole robot, and of the force on it, that the mesh contains
    /// ([`Mesh::share`]).
    pub fn share(&self) -> f64 {
        self.share
    }

    /// Index of the unknown that is the robot's translation along x.
    pub fn robot(&self) -> usize {
        self.count - 1
    }

    /// True if the unknown is a slip along the robot's surface.
    pub fn is_slip(&self, unknown: u32) -> bool {
        (self.first_slip..self.robot()).contains(&(unknown as usize))
    }

    /// Unknowns in one component of a node's displacement, each with its coefficient.
    pub fn of(&self, node: u32, component: usize) -> &[(u32, f64)] {
        let at = 3 * node as usize + component;
        &self.terms[self.start[at] as usize..self.start[at + 1] as usize]
    }

    /// Returns the displacement (m) of every node for a vector of unknowns.
    pub fn nodal_displacement(&self, values: &[f64]) -> Vec<[f64; 3]> {
        let n_nodes = (self.start.len() - 1) / 3;
        let value = |node: u32, i: usize| self.of(node, i).iter().map(|(u, share)| share * values[*u as usize]).sum();
        (0..n_nodes as u32).map(|node| std::array::from_fn(|i| value(node, i))).collect()
    }

    /// Elimination order of the unknowns that follows from an order of the nodes. Slips follow
    /// their node. The robot's translation is last.
    pub fn elimination_order(&self, node_order: &[usize]) -> Vec<usize> {
        let mut is_taken = vec![false; self.count];
        is_taken[self.robot()] = true;
        let mut order = Vec::with_capacity(self.count);
        for &node in node_order {
            for (unknown, _) in (0..3).flat_map(|i| self.of(node as u32, i)) {
                let unknown = *unknown as usize;
                if !std::mem::replace(&mut is_taken[unknown], true) {
                    order.push(unknown);
                }
            }
        }
        order.push(self.robot());
        order
    }
}

/// Unit vector along the part of `direction` that is orthogonal to the orthonormal vectors
/// `others`. `None` if that part is zero.
fn left_of(direction: Vector3<f64>, others: &[Vector3<f64>]) -> Option<Vector3<f64>> {
    let left = others.iter().fold(direction, |left, other| left - other * other.dot(&left));
    (left.norm() > ZERO_DIRECTION_LENGTH).then(|| left.normalize())
}

/// Distinct surface normals of the robot at every node. Normals of smoothly adjacent faces are
/// averaged.
fn distinct_normals(mesh: &Mesh) -> Vec<Vec<Vector3<f64>>> {
    let distinct = |normals: Vec<Vector3<f64>>| {
        let mut sums: Vec<Vector3<f64>> = Vec::new();
        for normal in normals {
            match sums.iter_mut().find(|sum| sum.normalize().dot(&normal) > SAME_NORMAL) {
                Some(sum) => *sum += normal,
                None => sums.push(normal),
            }
        }
        sums.into_iter().map(|sum| sum.normalize()).collect()
    };
    robot_normals(mesh).into_iter().map(distinct).collect()
}
