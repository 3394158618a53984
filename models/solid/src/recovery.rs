//! Error estimate of a mesh, by stress recovery: difference between the stress of each element and the mean at the nodes.
//!
//! Zienkiewicz and Zhu, *Int. J. Numer. Meth. Engng* 24 (1987) 337-357: elements have different stresses at a shared
//! node, and the energy of the difference between the stress and its nodal mean estimates the energy of the error.

use crate::cells::Geometry;
use crate::mesh::MeshStiffness;

type Stress = [[f64; 3]; 3];

/// Returns twice the error energy of each column of displacements, J: the error of a stiffness under unit
/// displacements, or of a compliance under unit forces. Not real-time.
#[must_use]
pub fn twice_error_j(body: &MeshStiffness<'_>, displacement: &[f64], columns: usize) -> Vec<f64> {
    let MeshStiffness { mesh, lame } = body;
    let zero: Stress = [[0.0; 3]; 3];
    let mut smooth = vec![zero; mesh.nodes_m.len() * columns];
    let mut around = vec![0.0; mesh.nodes_m.len()];
    let stress = |nodes: &[usize], slopes: &[[f64; 3]], column: usize| -> Stress {
        let mut gradient = zero;
        for (&node, slope) in nodes.iter().zip(slopes) {
            for (i, row) in gradient.iter_mut().enumerate() {
                let u = displacement[(3 * node + i) * columns + column];
                row.iter_mut().zip(slope).for_each(|(g, s)| *g += u * s);
            }
        }
        let trace = lame.lambda_pa * (gradient[0][0] + gradient[1][1] + gradient[2][2]);
        [0, 1, 2].map(|i| {
            [0, 1, 2]
                .map(|j| lame.mu_pa * (gradient[i][j] + gradient[j][i]) + if i == j { trace } else { 0.0 })
        })
    };
    let places = |nodes: &[usize]| nodes.iter().map(|&node| mesh.nodes_m[node]).collect::<Vec<_>>();
    for element in &mesh.elements {
        let nodes_m = places(&element.nodes);
        let geometry = Geometry { kind: element.kind, nodes_m: &nodes_m };
        for (&node, at) in element.nodes.iter().zip(element.kind.node_places()) {
            let (slopes, _) = geometry.slopes(at);
            around[node] += 1.0;
            for column in 0..columns {
                let sum = &mut smooth[node * columns + column];
                for (row, more) in sum.iter_mut().zip(stress(&element.nodes, &slopes, column)) {
                    row.iter_mut().zip(more).for_each(|(s, m)| *s += m);
                }
            }
        }
    }
    let mut errors = vec![0.0; columns];
    for element in &mesh.elements {
        let nodes_m = places(&element.nodes);
        let geometry = Geometry { kind: element.kind, nodes_m: &nodes_m };
        for (at, weight) in element.kind.rule() {
            let shapes = element.kind.shapes(at);
            let (slopes, determinant) = geometry.slopes(at);
            for (column, error) in errors.iter_mut().enumerate() {
                let mut d = stress(&element.nodes, &slopes, column);
                for (&node, (share, _)) in element.nodes.iter().zip(&shapes) {
                    for (row, mean) in d.iter_mut().zip(smooth[node * columns + column]) {
                        row.iter_mut().zip(mean).for_each(|(s, m)| *s -= share * m / around[node]);
                    }
                }
                let square: f64 = d.iter().flatten().map(|c| c * c).sum();
                let trace = d[0][0] + d[1][1] + d[2][2];
                let bulk = lame.lambda_pa / (3.0 * lame.lambda_pa + 2.0 * lame.mu_pa);
                *error += weight * determinant * (square - bulk * trace * trace) / (2.0 * lame.mu_pa);
            }
        }
    }
    errors
}
