//! Bodies from files and of curved bricks: what is read, what is refused, and whether the answers are those of a solid.

use crate::contact::assert_refused;
use crate::table::rows;
use flotor_hal::{DVec3, Demand, orientation_from_rotation_vector};
use flotor_solid::atlas::Atlas;
use flotor_solid::cells::Kind;
use flotor_solid::description::{Body, Description, Tool};
use flotor_solid::dissection::{Stiffness, subtract_forces};
use flotor_solid::gmsh;
use flotor_solid::grid::Lame;
use flotor_solid::law::Law;
use flotor_solid::mesh::{Mesh, MeshStiffness};
use flotor_solid::punch::{Bond, Outline};
use flotor_solid::remainder::{Resolution, Size};
use flotor_solid::rigid::RigidPatch;
use std::fmt::Write as _;

const STANDARD: Resolution = Resolution::STANDARD;

/// A box of cells in Gmsh's format: bricks, or six tetrahedra each. `named`: axis, side (0 or 1) and name of a face.
struct Boxes {
    counts: [usize; 3],
    from_m: [f64; 3],
    to_m: [f64; 3],
    kind: Kind,
    named: Vec<(usize, usize, &'static str)>,
    /// Columns of cells that are not there: all of these along x and y.
    hole: [std::ops::Range<usize>; 2],
}

impl Boxes {
    /// Nodes by twice their index, 1 the first.
    fn node(&self, at: [usize; 3]) -> usize {
        (at[2] * (2 * self.counts[1] + 1) + at[1]) * (2 * self.counts[0] + 1) + at[0] + 1
    }

    /// Corners of the elements of a cell, by twice their index.
    fn elements(&self, cell: [usize; 3]) -> Vec<Vec<[usize; 3]>> {
        let corner = |c: [f64; 3]| [0, 1, 2].map(|k| 2 * (cell[k] + usize::from(c[k] > 0.0)));
        if self.kind == Kind::Brick {
            return vec![Kind::Brick.corner_places().into_iter().map(corner).collect()];
        }
        [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]]
            .into_iter()
            .enumerate()
            .map(|(i, order)| {
                let mut at = cell.map(|c| 2 * c);
                let mut path = vec![at];
                for axis in order {
                    at[axis] += 2;
                    path.push(at);
                }
                if i >= 3 {
                    path.swap(1, 2); // an odd order turns the element inside out
                }
                path
            })
            .collect()
    }

    fn text(&self) -> String {
        let half = |a: [usize; 3], b: [usize; 3]| [0, 1, 2].map(|k| (a[k] + b[k]) / 2);
        let mut volumes = Vec::new();
        let mut faces: Vec<Vec<Vec<usize>>> = vec![Vec::new(); self.named.len()];
        for z in 0..self.counts[2] {
            for y in 0..self.counts[1] {
                for x in 0..self.counts[0] {
                    if self.hole[0].contains(&x) && self.hole[1].contains(&y) {
                        continue;
                    }
                    for corners in self.elements([x, y, z]) {
                        let mut nodes: Vec<usize> = corners.iter().map(|&at| self.node(at)).collect();
                        for [a, b] in self.kind.edges() {
                            nodes.push(self.node(half(corners[*a], corners[*b])));
                        }
                        for face in 0..self.kind.faces().len() {
                            let own = self.kind.faces()[face];
                            for ((axis, side, _), list) in self.named.iter().zip(&mut faces) {
                                let plane = side * 2 * self.counts[*axis];
                                if own.iter().all(|&k| corners[k][*axis] == plane) {
                                    list.push(self.kind.face_nodes(face).iter().map(|&k| nodes[k]).collect());
                                }
                            }
                        }
                        volumes.push(nodes);
                    }
                }
            }
        }
        let side = self.counts.map(|n| 2 * n + 1);
        let mut text = String::from("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$PhysicalNames\n");
        writeln!(text, "{}", self.named.len() + 1).expect("text grows");
        for (i, (_, _, name)) in self.named.iter().enumerate() {
            writeln!(text, "2 {} \"{name}\"", i + 1).expect("text grows");
        }
        text += "3 9 \"body\"\n$EndPhysicalNames\n$Entities\n";
        writeln!(text, "0 0 {} 1", self.named.len()).expect("text grows");
        for i in 0..self.named.len() {
            writeln!(text, "{} 0 0 0 0 0 0 1 {} 0", i + 1, i + 1).expect("text grows");
        }
        text += "1 0 0 0 0 0 0 1 9 0\n$EndEntities\n$Nodes\n";
        let total = side[0] * side[1] * side[2];
        writeln!(text, "1 {total} 1 {total}\n3 1 0 {total}").expect("text grows");
        (1..=total).for_each(|tag| writeln!(text, "{tag}").expect("text grows"));
        for z in 0..side[2] {
            for y in 0..side[1] {
                for x in 0..side[0] {
                    let at = [x, y, z];
                    for k in 0..3 {
                        let share = at[k] as f64 / (side[k] - 1) as f64;
                        write!(text, "{:e} ", self.from_m[k] + share * (self.to_m[k] - self.from_m[k]))
                            .expect("text grows");
                    }
                    text.push('\n');
                }
            }
        }
        let count = volumes.len() + faces.iter().map(Vec::len).sum::<usize>();
        writeln!(text, "$EndNodes\n$Elements\n{} {count} 1 {count}", faces.len() + 1).expect("text grows");
        let mut tag = 0;
        let (flat, solid) = if self.kind == Kind::Brick { (16, 17) } else { (9, 11) };
        for (i, list) in faces.iter().chain([&volumes]).enumerate() {
            let is_volume = i == faces.len();
            let (dimension, entity, kind) = if is_volume { (3, 1, solid) } else { (2, i + 1, flat) };
            writeln!(text, "{dimension} {entity} {kind} {}", list.len()).expect("text grows");
            for nodes in list {
                tag += 1;
                write!(text, "{tag}").expect("text grows");
                nodes.iter().for_each(|node| write!(text, " {node}").expect("text grows"));
                text.push('\n');
            }
        }
        text + "$EndElements\n"
    }

    fn mesh(&self) -> Mesh {
        Mesh::new(gmsh::read(&self.text()).expect("a mesh"), "fixed", "touched").expect("a body")
    }
}

fn beam(kind: Kind, counts: [usize; 3]) -> Boxes {
    let (from_m, to_m) = ([-0.2, -0.02, -0.02], [0.0, 0.02, 0.02]);
    Boxes { counts, from_m, to_m, kind, named: vec![(0, 0, "fixed"), (0, 1, "touched")], hole: [0..0, 0..0] }
}

fn cube(kind: Kind, count: usize) -> Boxes {
    // Off the origin: the body is moved so that the middle of its touched face is there.
    let (from_m, to_m) = ([0.01, 0.02, 0.03], [0.09, 0.10, 0.11]);
    let named = vec![(2, 0, "fixed"), (2, 1, "touched")];
    Boxes { counts: [count; 3], from_m, to_m, kind, named, hole: [0..0, 0..0] }
}

fn on_mesh(tool: Tool, poisson_ratio: f64, mesh: &Mesh) -> (Law, f64) {
    let body = Body::File { digest: 0 };
    Description { body, tool, poisson_ratio, resolution: STANDARD }.solve_on(mesh).expect("a solid")
}

/// The bounds of the table's makers on their own mesh: 2 %, 525 corners.
#[test]
fn a_plate_on_a_beam_from_a_file() {
    if crate::leaves_out_long_tests() {
        return;
    }
    for kind in [Kind::Tetrahedron, Kind::Brick] {
        let mesh = beam(kind, [20, 4, 4]).mesh();
        for nu in [0.3, 0.45] {
            let (Law::Bonded(patch), mesh_error) = on_mesh(Tool::Plate, nu, &mesh) else {
                panic!("a rigid patch")
            };
            let mut worst: f64 = 0.0;
            for row in rows("solid/a_cantilever_plate.csv").iter().filter(|row| row.number("nu") == nu) {
                let rotation = orientation_from_rotation_vector(row.vector(["rx_rad", "ry_rad", "rz_rad"]));
                let (wrench, _) = patch.answer(row.vector(["x_m", "y_m", "z_m"]), rotation, Demand::ALL);
                let modulus = row.number("E_pa");
                let force = row.vector(["fx_n", "fy_n", "fz_n"]);
                let torque = row.vector(["tx_nm", "ty_nm", "tz_nm"]);
                let miss = (wrench.force() * modulus - force).length()
                    + (wrench.torque() * modulus - torque).length() / 0.02;
                let error = miss / (force.length() + torque.length() / 0.02);
                assert!(error < 0.02, "{kind:?} {}: {error}", row.text("id"));
                worst = worst.max(error);
            }
            println!("{kind:?} nu {nu}: worst {worst:.4}, estimated {mesh_error:.4}");
            assert!(mesh_error > 0.0 && mesh_error < 0.1, "{mesh_error}");
        }
    }
}

/// The bound of the block's own rows, on sixteen-millimetre bricks: the half-space carries the contact.
#[test]
fn a_sphere_on_a_block_from_a_file() {
    if crate::leaves_out_long_tests() {
        return;
    }
    let mesh = cube(Kind::Brick, 5).mesh();
    let (nu, radius_m) = (0.45, 0.0127);
    let (Law::Sphere(atlas), mesh_error) = on_mesh(Tool::Sphere { radius_m }, nu, &mesh) else {
        panic!("a sphere")
    };
    println!("estimated {mesh_error:.4}");
    let table = rows("solid/b_block_sphere.csv");
    let own = |category: &str| category.starts_with("centre") || category.starts_with("q34");
    let mut seen = 0;
    for row in table.iter().filter(|row| own(row.text("category"))) {
        if row.number("nu") != nu || row.number("radius_m") != radius_m {
            continue;
        }
        seen += 1;
        let answer = atlas.answer(row.vector(["cx_m", "cy_m", "cz_m"]).to_array());
        let force = DVec3::from_array(answer.energy.slope) * -row.number("E_pa");
        let truth = row.vector(["fx_n", "fy_n", "fz_n"]);
        let error = (force - truth).length() / truth.length();
        println!("{} force {error:.4}", row.text("id"));
        assert!(error < 0.03 && !answer.is_extrapolated, "{}: {error}", row.text("id"));
    }
    assert!(seen >= 4);
    assert!(atlas.answer([0.041, 0.0, 0.010]).is_extrapolated);
}

/// Where a face does not fill its box there are places of the law with nothing below them.
#[test]
fn a_sphere_on_a_face_that_does_not_fill_its_box() {
    if crate::leaves_out_long_tests() {
        return;
    }
    let radius_m = 0.01;
    let law = |hole: [std::ops::Range<usize>; 2]| {
        let mesh = Boxes { hole, ..cube(Kind::Brick, 4) }.mesh();
        let (Law::Sphere(atlas), _) = on_mesh(Tool::Sphere { radius_m }, 0.3, &mesh) else {
            panic!("a sphere")
        };
        atlas
    };
    let [whole, with_hole] = [law([0..0, 0..0]), law([2..4, 2..4])];
    for depth_m in [0.0005, 0.002, 0.005] {
        // The middle of the quarter opposite to the hole, and places all over the box.
        let energy = |atlas: &Atlas, x: f64, y: f64| atlas.answer([x, y, radius_m - depth_m]).energy;
        let ratio = energy(&with_hole, -0.02, -0.02).value / energy(&whole, -0.02, -0.02).value;
        println!("{depth_m}: {ratio:.4}");
        assert!(ratio > 0.7 && ratio < 1.0, "{depth_m}: {ratio}");
        for k in 0..400 {
            let (x, y) = (-0.039 + 0.0039 * f64::from(k % 20), -0.039 + 0.0039 * f64::from(k / 20));
            let there = energy(&with_hole, x, y);
            let is_finite = there.slope.iter().all(|slope| slope.is_finite());
            assert!(is_finite && there.value > 0.0 && there.slope[2] < 0.0, "{x} {y} {depth_m}: {there:?}");
        }
    }
}

#[test]
fn a_punch_on_a_block_from_a_file_is_that_on_a_block() {
    if crate::leaves_out_long_tests() {
        return;
    }
    let mesh = cube(Kind::Tetrahedron, 4).mesh();
    let tool = Tool::Punch { outline: Outline::Square { half_m: 0.01 }, bond: Bond::Bonded };
    let size = Size { half_x_m: 0.04, half_y_m: 0.04, height_m: 0.08 };
    let block = Description { body: Body::Block(size), tool, poisson_ratio: 0.3, resolution: STANDARD };
    let ((Law::Bonded(one), _), (Law::Bonded(other), _)) =
        (on_mesh(tool, 0.3, &mesh), block.solve().expect("a solid"))
    else {
        panic!("a rigid patch")
    };
    for i in 0..12 {
        let (a, b) = (one.stiffness[i][i], other.stiffness[i][i]);
        // A third of the bound on a punch's force.
        assert!((a - b).abs() <= 0.01 * b, "{i}: {a} {b}");
    }
}

/// Displacements of the outside prescribed as a linear field: the inside follows exactly, for both elements.
#[test]
fn a_linear_field_on_the_outside_of_a_mesh_continues_inside() {
    let gradient = [[0.01, 0.02, -0.03], [0.005, -0.02, 0.04], [0.03, 0.01, 0.02]];
    for kind in [Kind::Tetrahedron, Kind::Brick] {
        let mesh = cube(kind, 3).mesh();
        let outside: Vec<bool> = {
            let mut outside = mesh.fixed.clone();
            let faces = mesh.free.iter().chain(&mesh.touched);
            faces.flat_map(|facet| &facet.nodes).for_each(|&node| outside[node] = true);
            outside
        };
        let body = MeshStiffness { mesh: &mesh, lame: Lame::new(1.0e4, 0.45) };
        let stiffness = Stiffness::new(&body, outside.iter().map(|&o| [o; 3]).collect()).expect("a solid");
        let exact: Vec<f64> = (0..3 * mesh.nodes_m.len())
            .map(|k| (0..3).map(|j| gradient[k % 3][j] * mesh.nodes_m[k / 3][j]).sum())
            .collect();
        let prescribed: Vec<f64> =
            exact.iter().enumerate().map(|(k, u)| if outside[k / 3] { *u } else { 0.0 }).collect();
        let mut u = vec![0.0; exact.len()];
        subtract_forces(&body, &prescribed, &mut u, 1);
        stiffness.solve(&mut u, 1);
        let used: std::collections::BTreeSet<usize> =
            mesh.elements.iter().flat_map(|element| element.nodes.clone()).collect();
        let inside: Vec<usize> = used.into_iter().filter(|&node| !outside[node]).collect();
        assert!(inside.len() > 30);
        for k in inside.into_iter().flat_map(|node| 3 * node..3 * node + 3) {
            // The bound, relative to the size of the field on eighty millimetres.
            assert!((u[k] - exact[k]).abs() < 1.0e-10 * 0.003, "{kind:?}: {:e}", u[k] - exact[k]);
        }
    }
}

/// Torsion of a round bar between bonded ends is G J / L; a bar has no direction across its axis.
#[test]
fn a_cylinder_twists_as_a_round_bar_does() {
    if crate::leaves_out_long_tests() {
        return;
    }
    let (radius_m, height_m, poisson_ratio) = (0.02, 0.05, 0.3);
    let body = Body::Cylinder { radius_m, height_m };
    let description = Description { body, tool: Tool::Plate, poisson_ratio, resolution: STANDARD };
    let (Law::Bonded(patch), _) = description.solve().expect("a solid") else { panic!("a rigid patch") };
    let k = &patch.stiffness;
    let (xy, yx) = (RigidPatch::entry(0, 1), RigidPatch::entry(1, 0));
    let torsion = k[xy][xy] + k[yx][yx] - 2.0 * k[xy][yx];
    let exact = 0.5 / 1.3 * 0.5 * std::f64::consts::PI * radius_m.powi(4) / height_m;
    // 24 quadratic arcs follow a circle to 1e-5 of its radius, to the fourth power.
    assert!((torsion / exact - 1.0).abs() < 2.0e-4, "{torsion} {exact}");
    assert!((k[0][0] / k[1][1] - 1.0).abs() < 1.0e-9);
}

/// More material is stiffer: a cylinder lies between the blocks inside and around it, and its force is the slope of its energy.
#[test]
fn a_sphere_on_a_cylinder_lies_between_two_blocks() {
    if crate::leaves_out_long_tests() {
        return;
    }
    let (radius_m, poisson_ratio) = (0.0127, 0.3);
    let solve = |body| {
        let description = Description {
            body,
            tool: Tool::Sphere { radius_m },
            poisson_ratio,
            resolution: Resolution::QUICK,
        };
        let (Law::Sphere(atlas), _) = description.solve().expect("a solid") else { panic!("a sphere") };
        atlas
    };
    let block = |half_m: f64| Body::Block(Size { half_x_m: half_m, half_y_m: half_m, height_m: 0.04 });
    let cylinder = solve(Body::Cylinder { radius_m: 0.02, height_m: 0.04 });
    // Each takes some seconds to solve: in every change's checks the one inside, which differs more.
    for half_m in &[0.02 * 0.5_f64.sqrt(), 0.02][..crate::cases(1, 2)] {
        let block = solve(block(*half_m));
        for depth_m in [0.002, 0.004, 0.008] {
            let at = [0.0, 0.0, radius_m - depth_m];
            let ratio = cylinder.answer(at).energy.value / block.answer(at).energy.value;
            println!("{half_m} {depth_m}: {ratio:.4}");
            let is_between = if *half_m < 0.02 { ratio > 1.0 } else { ratio < 1.0 };
            assert!(is_between, "{half_m} {depth_m}: {ratio}");
        }
    }
    for k in 0..400 {
        let turn = 0.37 * f64::from(k);
        let out = 0.03 * f64::from(k) / 400.0;
        let at = DVec3::new(out * turn.cos(), out * turn.sin(), 0.012 - 0.03 * f64::from(k % 7) / 7.0);
        let energy = |at: DVec3| cylinder.answer(at.to_array()).energy;
        let h = 1.0e-7;
        for (axis, slope) in DVec3::AXES.into_iter().zip(energy(at).slope) {
            let difference = (energy(at + axis * h).value - energy(at - axis * h).value) / (2.0 * h);
            let size = DVec3::from_array(energy(at).slope).length().max(1.0e-6);
            assert!((slope - difference).abs() < 1.0e-4 * size, "{at}: {slope} {difference}");
        }
    }
}

/// Every file that is no body is refused with the reason and the remedy.
#[test]
fn files_that_are_no_body_are_refused() {
    let good = cube(Kind::Tetrahedron, 1).text();
    let without = |name: &str| good.replace(&format!("\"{name}\""), "\"other\"");
    let element = |change: fn(&mut Vec<String>)| {
        // The first element of volume: its line follows that of its block.
        let mut lines: Vec<String> = good.lines().map(str::to_owned).collect();
        let block = lines.iter().position(|line| line == "3 1 11 6").expect("a block");
        let mut words: Vec<String> = lines[block + 1].split(' ').map(str::to_owned).collect();
        change(&mut words);
        lines[block + 1] = words.join(" ");
        lines.join("\n") + "\n"
    };
    let inverted = element(|words| words.swap(1, 2));
    let unknown = element(|words| words[1] = "999".to_owned());
    let short = element(|words| words.truncate(5));
    // One of the six elements under a face is gone: the face is open there.
    let open = {
        let lines: Vec<&str> = good.lines().collect();
        let block = lines.iter().position(|line| *line == "3 1 11 6").expect("a block");
        let mut lines: Vec<String> = lines.into_iter().map(str::to_owned).collect();
        lines[block] = "3 1 11 5".to_owned();
        lines.remove(block + 1);
        lines.join("\n") + "\n"
    };
    let surface_only = {
        let block = good.find("3 1 11 6").expect("a block");
        good[..block].replace("\n3 10 1 10\n", "\n2 4 1 4\n") + "$EndElements\n"
    };
    let apart = cube(Kind::Brick, 1);
    // Two blocks of a size that is allowed.
    let in_blocks = {
        let block = |from: usize| {
            let tags: String = (from..from + 30_000).map(|tag| format!("{tag}\n")).collect();
            format!("3 1 0 30000\n{tags}{}", "0 0 0\n".repeat(30_000))
        };
        format!(
            "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n2 40000 1 40000\n{}{}",
            block(1),
            block(30_001)
        )
    };
    for (text, wanted) in [
        (String::new(), "MeshFormat"),
        ("solid cube\nfacet normal 0 0 1\n".to_owned(), "not a Gmsh mesh"),
        (good.replace("4.1 0 8", "2.2 0 8"), "4.1"),
        (good.replace("4.1 0 8", "4.1 1 8"), "binary"),
        (without("fixed"), "no fixed nodes"),
        (without("touched"), "nothing to touch"),
        (inverted, "inverted"),
        (unknown, "999"),
        (short, "missing"),
        (open, "not on the border"),
        (surface_only, "open surface and no volume"),
        (good.replace("3 1 11 6", "3 1 4 6"), "quadratic"),
        (good.replace("3 1 11 6", "3 1 14 6"), "type 14"),
        (good.replace("$EndElements\n", ""), "$EndElements"),
        (Boxes { to_m: [90.0; 3], ..apart }.text(), "metres"),
        (good.replace("3 1 0 27", "3 1 0 99999999999"), "exceed the limit"),
        (good.lines().take(59).collect::<Vec<_>>().join("\n"), "ends here"),
        (in_blocks, "exceed the limit"),
        // The number with no opposite: a physical group by its number, not a crash.
        (
            good.replace("1 0 0 0 0 0 0 1 1 0\n2", "1 0 0 0 0 0 0 1 -9223372036854775808 0\n2"),
            "9223372036854775808",
        ),
    ] {
        let refusal = match gmsh::read(&text) {
            Ok(parts) => Mesh::new(parts, "fixed", "touched").map(|_| ()).map_err(|error| error.to_string()),
            Err(error) => Err(error.to_string()),
        };
        let refusal = refusal.expect_err(wanted);
        assert!(refusal.contains(wanted), "{wanted}: {refusal}");
    }
    let same_face = Mesh::new(gmsh::read(&good).expect("it is read"), "fixed", "fixed").map(|_| ());
    let refusal = same_face.expect_err("nothing could move").to_string();
    assert!(refusal.contains("are both \"fixed\""), "{refusal}");
    // Cut anywhere, a file is refused or read, and nothing panics.
    for end in (0..good.len()).step_by(37) {
        if let Ok(parts) = gmsh::read(&good[..end]) {
            let _ = Mesh::new(parts, "fixed", "touched");
        }
    }
}

/// The plugin names the parameter that does not fit.
#[test]
fn settings_of_a_mesh_that_do_not_fit_are_refused() {
    assert_refused(&[
        (&[("body", "file")], "set `file`"),
        (&[("body", "file"), ("file", "/nonexistent.msh")], "cannot read"),
        (&[("file", "a.msh")], "body = \"file\""),
        (&[("fixed_face", "bottom")], "body = \"file\""),
        (&[("body", "file"), ("file", "a.msh"), ("size_x_mm", "10")], "size_x_mm"),
        (&[("body", "cylinder"), ("size_y_mm", "10")], "size_y_mm"),
        (&[("body", "cylinder"), ("tool_radius_mm", "60")], "tool_radius_mm"),
    ]);
}
