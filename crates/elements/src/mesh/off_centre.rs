//! Built-in meshes of a robot away from the vitreous's centre. A conformal map displaces the robot
//! of a centred mesh. If the offset breaks a symmetry, the mirror image is added.
//!
//! The map is the Möbius map of a ball onto itself that moves the centre to the robot's position.
//! It maps spheres to spheres and keeps angles. Elements are therefore as well shaped as in the
//! centred mesh, and small where the gap to the outer surface is small. Near the robot the map is a
//! translation plus terms of second order. These terms are reduced to zero at the robot, so that
//! its surface keeps its shape exactly.

use super::{ElementKind, HEXAHEDRON27_REFERENCE_NODES, Mesh};
use base::error::{Error, Result};
use record::{Offset, OffsetDirection};

/// Position of the robot in the ball of gel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OffCentre {
    /// Radius of the fixed outer surface in m.
    pub outer_radius_m: f64,
    /// Vector from the outer surface's centre to the robot's centre.
    pub offset: Offset,
}

impl OffCentre {
    /// Offset divided by the outer radius.
    fn share(&self) -> f64 {
        self.offset.distance_m / self.outer_radius_m
    }

    /// Outer radius (m) that the centred mesh must have. The map moves the sphere of this radius to
    /// the real outer surface and keeps the robot's size.
    pub fn centred_outer_radius_m(&self) -> f64 {
        self.outer_radius_m * (1.0 - self.share() * self.share())
    }

    /// Displaces the robot of a centred mesh of hexahedra whose outer radius is
    /// [`Self::centred_outer_radius_m`]. The nodes must be ordered in sheets from the robot
    /// outwards. The robot's centre stays at the origin. The result is a quarter model if the
    /// offset is along the force, and a half model if it is across the force.
    ///
    /// # Errors
    /// [`Error::Numerical`] if the offset is not smaller than the outer radius, or if the mesh does
    /// not consist of sheets of hexahedra.
    pub fn displace_mesh(&self, centred: Mesh) -> Result<Mesh> {
        let n_sheet = centred.robot_nodes.len();
        let is_layered = centred.element_kind == ElementKind::Hexahedron27
            && n_sheet > 0
            && centred.n_nodes().is_multiple_of(n_sheet)
            && centred.n_nodes() > n_sheet;
        if !(is_layered && (0.0..1.0).contains(&self.share())) {
            return Err(Error::numerical(
                format!(
                    "no mesh can be moved by {} m off the centre of a sphere of radius {} m",
                    self.offset.distance_m, self.outer_radius_m
                ),
                "give an offset that leaves the robot inside the vitreous, and a mesh in layers",
            ));
        }
        let weights = sheet_weights(&centred, n_sheet);
        let mut weight: Vec<f64> = (0..centred.n_nodes()).map(|node| weights[node / n_sheet]).collect();
        let mut mesh = centred;
        if self.offset.direction == OffsetDirection::Across {
            let original = mirrored(&mut mesh);
            weight.extend(original.iter().map(|&node| weights[node as usize / n_sheet]));
        }
        for (place_m, weight) in mesh.node_coordinates_m.iter_mut().zip(weight) {
            if weight > 0.0 {
                let mapped_m = self.mapped_m(*place_m);
                *place_m = std::array::from_fn(|i| (1.0 - weight) * place_m[i] + weight * mapped_m[i]);
            }
        }
        Ok(mesh)
    }

    /// Applies the Möbius map R [((1 + 2a·u + u²)a + (1 − a²)u)/(1 + 2a·u + a²u²) − a] to a
    /// position. R is the outer radius, a the offset divided by R, and u the position divided by
    /// [`Self::centred_outer_radius_m`]. The derivative at the origin is 1.
    fn mapped_m(&self, place_m: [f64; 3]) -> [f64; 3] {
        let (a, axis) = (self.share(), self.offset.direction.axis());
        let u = place_m.map(|x| x / self.centred_outer_radius_m());
        let squared: f64 = u.iter().map(|x| x * x).sum();
        let below = 1.0 + 2.0 * a * u[axis] + a * a * squared;
        // Along the axis, the terms that contain a but not u cancel:
        // (1 + 2au + u²)a − a(1 + 2au + a²u²) = a u² (1 − a²).
        std::array::from_fn(|i| {
            let along = if i == axis { a * squared } else { 0.0 };
            self.centred_outer_radius_m() * (u[i] + along) / below
        })
    }
}

/// Weight of the map's second-order terms on each sheet of nodes: 0 at the robot, 1 at the outer
/// surface. Between them, the weight is a function of the logarithm of the sheet's size. Its slope
/// is zero at the outer surface.
fn sheet_weights(mesh: &Mesh, n_sheet: usize) -> Vec<f64> {
    let radius_m = |x: &[f64; 3]| x.iter().map(|c| c * c).sum::<f64>().sqrt();
    let sizes_m: Vec<f64> = mesh
        .node_coordinates_m
        .chunks_exact(n_sheet)
        .map(|sheet| sheet.iter().map(radius_m).sum::<f64>() / n_sheet as f64)
        .collect();
    let (first_m, last) = (sizes_m[0], sizes_m.len() - 1);
    let weight = |i: usize| {
        if i == last {
            return 1.0;
        }
        let place = (sizes_m[i] / first_m).ln() / (sizes_m[last] / first_m).ln();
        place * (2.0 - place)
    };
    (0..=last).map(weight).collect()
}

/// Adds the mirror image of a mesh at the plane y = 0. Returns, for each new node, the node of
/// which it is the image.
fn mirrored(mesh: &mut Mesh) -> Vec<u32> {
    let n_nodes = mesh.n_nodes() as u32;
    let mut image: Vec<u32> = (0..n_nodes).collect();
    let mut original = Vec::new();
    for node in (0..n_nodes).filter(|node| mesh.symmetry_y_nodes.binary_search(node).is_err()) {
        image[node as usize] = n_nodes + original.len() as u32;
        original.push(node);
        let [x, y, z] = mesh.node_coordinates_m[node as usize];
        mesh.node_coordinates_m.push([x, -y, z]);
    }
    // Mirroring inverts the elements. Reversing one reference direction makes their Jacobians
    // positive again.
    let turned: Vec<usize> = HEXAHEDRON27_REFERENCE_NODES
        .iter()
        .map(|[u, v, w]| HEXAHEDRON27_REFERENCE_NODES.iter().position(|other| other == &[-u, *v, *w]).unwrap_or(0))
        .collect();
    let images: Vec<u32> = mesh.elements().flat_map(|nodes| turned.iter().map(|&k| image[nodes[k] as usize])).collect();
    mesh.connectivity.extend(images);
    for nodes in [&mut mesh.robot_nodes, &mut mesh.outer_nodes, &mut mesh.symmetry_z_nodes] {
        let new: Vec<u32> = nodes.iter().map(|&node| image[node as usize]).filter(|&node| node >= n_nodes).collect();
        nodes.extend(new);
    }
    mesh.symmetry_y_nodes.clear();
    original
}
