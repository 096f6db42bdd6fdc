//! Tests of the elimination order. It must be a permutation, put separators last, and fill the
//! factor far less than a minimum-degree order.

use std::collections::HashMap;

use faer::Side;
use faer::sparse::SymbolicSparseColMat;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, SymbolicCholeskyRaw, SymmetricOrdering, factorize_symbolic_cholesky,
};

use super::nested_dissection;

type Nodes = (Vec<[f64; 3]>, Vec<u32>);

/// A quarter ball around a quarter sphere, of elements with 27 nodes. It has cube-sphere patches of
/// `n` elements per quarter face and `n_layers` radial layers.
fn quarter_shell(n: i32, n_layers: usize) -> Nodes {
    let m = 2 * n;
    type Face = (i32, fn(i32, i32, i32) -> [i32; 3]);
    let faces: [Face; 4] = [
        (1, |u, v, m| [m, u, v]),
        (1, |u, v, m| [-m, u, v]),
        (2, |u, v, m| [u - m, m, v]),
        (2, |u, v, m| [u - m, v, m]),
    ];
    let mut surface = HashMap::new();
    let mut points = Vec::new();
    let mut quads = Vec::new();
    for (width, position) in faces {
        for (j, i) in (0..n).flat_map(|j| (0..width * n).map(move |i| (j, i))) {
            let quad: [u32; 9] = std::array::from_fn(|k| {
                let point = position(2 * i + k as i32 % 3, 2 * j + k as i32 / 3, m);
                *surface.entry(point).or_insert_with(|| {
                    points.push(point);
                    points.len() as u32 - 1
                })
            });
            quads.push(quad);
        }
    }
    let mut coordinates = Vec::new();
    for level in 0..=2 * n_layers {
        let radius = (1.0 + level as f64 / n_layers as f64).powi(3);
        for point in &points {
            let length = point.iter().map(|c| f64::from(c * c)).sum::<f64>().sqrt();
            coordinates.push(point.map(|c| radius * f64::from(c) / length));
        }
    }
    let mut elements = Vec::new();
    for (layer, quad) in (0..n_layers).flat_map(|layer| quads.iter().map(move |quad| (layer, quad))) {
        for level in 2 * layer..2 * layer + 3 {
            elements.extend(quad.map(|node| (level * points.len()) as u32 + node));
        }
    }
    (coordinates, elements)
}

/// Number of multiplications in a Cholesky factorisation of the node graph, counted from faer's
/// supernodes. Without an `order`, faer chooses a minimum-degree order.
fn factor_work(n_nodes: usize, elements: &[u32], nodes_per_element: usize, order: Option<&[usize]>) -> f64 {
    let mut columns = vec![Vec::new(); n_nodes];
    for nodes in elements.chunks_exact(nodes_per_element) {
        for &j in nodes {
            columns[j as usize].extend(nodes.iter().map(|&i| i as usize).filter(|&i| i >= j as usize));
        }
    }
    let (mut starts, mut rows) = (vec![0], Vec::new());
    for column in &mut columns {
        column.sort_unstable();
        column.dedup();
        rows.extend_from_slice(column);
        starts.push(rows.len());
    }
    let pattern = SymbolicSparseColMat::new_checked(n_nodes, n_nodes, starts, None, rows);
    let inverse = order.map(|order| {
        let mut inverse = vec![0; n_nodes];
        for (k, &node) in order.iter().enumerate() {
            inverse[node] = k;
        }
        inverse
    });
    let ordering = match (order, &inverse) {
        (Some(order), Some(inverse)) => {
            SymmetricOrdering::Custom(faer::perm::PermRef::new_checked(order, inverse, n_nodes))
        }
        _ => SymmetricOrdering::Amd,
    };
    let parameters = CholeskySymbolicParams {
        supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
        ..Default::default()
    };
    let symbolic = factorize_symbolic_cholesky(pattern.as_ref(), Side::Lower, ordering, parameters).unwrap();
    let SymbolicCholeskyRaw::Supernodal(factor) = symbolic.raw() else { panic!("supernodal was asked for") };
    let mut work = 0.0;
    for s in 0..factor.n_supernodes() {
        let n_columns = (factor.supernode_end()[s] - factor.supernode_begin()[s]) as f64;
        let n_rows = factor.supernode(s).pattern().len() as f64;
        work += n_columns.powi(3) / 3.0 + n_columns * n_columns * n_rows + n_columns * n_rows * n_rows;
    }
    work
}

fn assert_permutation(order: &[usize], n_nodes: usize) {
    let mut sorted = order.to_vec();
    sorted.sort_unstable();
    assert!(sorted.into_iter().eq(0..n_nodes));
}

#[test]
fn a_shell_of_sixty_thousand_unknowns_needs_a_third_of_the_work_of_minimum_degree() {
    let (coordinates, elements) = quarter_shell(6, 12);
    let n_nodes = coordinates.len();
    let order = nested_dissection(n_nodes, &elements, 27, &coordinates);
    assert_permutation(&order, n_nodes);
    let dissected = factor_work(n_nodes, &elements, 27, Some(&order));
    let minimum_degree = factor_work(n_nodes, &elements, 27, None);
    assert!(dissected < minimum_degree / 3.0, "{dissected:.3e} against {minimum_degree:.3e}");
}

#[test]
fn numbering_of_the_elements_does_not_matter_much() {
    // The elements are shuffled. A cut that followed the numbering instead of the geometry would
    // then lose its small separators.
    let (coordinates, elements) = quarter_shell(3, 5);
    let n_nodes = coordinates.len();
    let n_elements = elements.len() / 27;
    let shuffled: Vec<u32> =
        (0..n_elements).flat_map(|k| elements[k * 97 % n_elements * 27..][..27].iter().copied()).collect();
    assert_ne!(n_elements % 97, 0, "the stride must visit every element");
    let work = |elements: &[u32]| {
        factor_work(n_nodes, elements, 27, Some(&nested_dissection(n_nodes, elements, 27, &coordinates)))
    };
    let (as_made, after) = (work(&elements), work(&shuffled));
    assert!((after / as_made - 1.0).abs() < 0.1, "{as_made:.3e} became {after:.3e}");
}

#[test]
fn unstructured_tetrahedra_need_less_work_than_minimum_degree() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/gmsh/quarter_sphere_tet10.msh");
    let mesh = crate::mesh::gmsh::read_gmsh(file, 1e-3).unwrap().mesh;
    let order = nested_dissection(mesh.n_nodes(), &mesh.connectivity, 10, &mesh.node_coordinates_m);
    assert_permutation(&order, mesh.n_nodes());
    let dissected = factor_work(mesh.n_nodes(), &mesh.connectivity, 10, Some(&order));
    let minimum_degree = factor_work(mesh.n_nodes(), &mesh.connectivity, 10, None);
    assert!(dissected < minimum_degree, "{dissected:.3e} against {minimum_degree:.3e}");
}

#[test]
fn the_middle_of_a_chain_is_eliminated_last() {
    // The elements are bars 0–1, 1–2, …. The best separator of 64 bars is node 32.
    let elements: Vec<u32> = (0..64).flat_map(|k| [k, k + 1]).collect();
    let coordinates: Vec<[f64; 3]> = (0..65).map(|k| [f64::from(k), 1.0, 0.0]).collect();
    let order = nested_dissection(65, &elements, 2, &coordinates);
    assert_permutation(&order, 65);
    assert_eq!(order.last(), Some(&32));
}

#[test]
fn unused_nodes_come_first_and_an_empty_mesh_is_no_trouble() {
    let coordinates = vec![[0.0; 3]; 6];
    let order = nested_dissection(6, &[1, 2, 2, 4], 2, &coordinates);
    assert_permutation(&order, 6);
    assert_eq!(order[..3], [0, 3, 5]);
    assert_eq!(nested_dissection(2, &[], 27, &coordinates), [0, 1]);
}

#[test]
fn coincident_and_non_finite_coordinates_are_survived() {
    let (coordinates, elements) = quarter_shell(2, 2);
    for wrong in [[0.0; 3], [f64::NAN; 3]] {
        let flat = vec![wrong; coordinates.len()];
        assert_permutation(&nested_dissection(flat.len(), &elements, 27, &flat), flat.len());
    }
}
