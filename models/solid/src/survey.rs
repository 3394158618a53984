//! Preparation of the law of a ball anywhere on a mesh: choice of places, contacts at them, fit and error estimate. Not real-time.

use crate::anywhere::{Anywhere, DEEPEST};
use crate::condensation::Condensation;
use crate::dense::NotPositive;
use crate::jet::Jet;
use crate::lattice::{Datum, Lattice};
use crate::mesh::Mesh;
use crate::refinement::Grading;
use crate::touch::{Touch, Zone};
use flotor_hal::{DVec3, math};
use std::collections::HashMap;

/// Contact at one place of the centre.
#[derive(Clone, Copy, Debug, Default)]
struct Sample {
    centre_m: DVec3,
    depth_m: f64,
    /// Zero where too few cells are in contact.
    energy_j: f64,
    force_n: DVec3,
}

/// Place of the survey: a line of centres towards the surface.
#[derive(Clone, Debug, Default)]
struct Column {
    /// Centre in the middle of the line, m.
    at_m: DVec3,
    /// Centre at first touch, and direction away from the surface.
    first_m: DVec3,
    normal: DVec3,
    /// Where the mesh is refined, m.
    points_m: Vec<[f64; 3]>,
    /// Contacts by growing depth.
    samples: Vec<Sample>,
    /// Relative error of the law before it knew this place, and after.
    errors: [f64; 2],
}

/// Depths of the contacts, in radii.
const DEPTHS: [f64; 5] = [0.14, 0.3, 0.5, 0.7, 0.92];
/// Number of cells below which a contact says nothing.
const FEWEST: usize = 5;
/// Step of the lattice, in radii.
const STEP: f64 = 0.4;
/// Places solved between two fits.
const BATCH: usize = 24;
/// Share of the error before a place was known that is taken to remain around it.
const REMAINING: f64 = 0.3;
/// Error of a contact on its refined mesh.
const OF_MESH: f64 = 0.015;
/// Distances of the surface are measured up to this one, in radii.
const SIGHT: f64 = 1.6;

/// Points of the touched surface with the normals there, sorted into boxes.
struct Surface {
    boxes: HashMap<[i32; 3], Vec<[DVec3; 2]>>,
    radius_m: f64,
    /// Nodes that do not move, m.
    fixed_m: Vec<DVec3>,
}

/// Distance of the points of the surface, in radii.
const SPACING: f64 = 0.1;
/// The law ends nearer than this to a node that does not move, in radii.
const HELD: f64 = 1.1;

impl Surface {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // some hundred points a side
    fn new(mesh: &Mesh, radius_m: f64) -> Self {
        let fixed = mesh.nodes_m.iter().zip(&mesh.fixed).filter(|node| *node.1);
        let fixed_m = fixed.map(|node| DVec3::from_array(*node.0)).collect();
        let mut all = Self { boxes: HashMap::new(), radius_m, fixed_m };
        for facet in mesh.touched.iter().filter(|facet| facet.corners == 3) {
            let corner = |k: usize| DVec3::from_array(mesh.nodes_m[facet.nodes[k % 3]]);
            let side_m = (0..3).map(|k| corner(k).distance(corner(k + 1))).fold(0.0, f64::max);
            let count = (side_m / (SPACING * radius_m)).ceil().min(300.0) as usize;
            for (i, j) in (0..=count).flat_map(|i| (0..=count - i).map(move |j| (i, j))) {
                let point = facet.point(&mesh.nodes_m, [i, j].map(|c| c as f64 / count as f64), 1.0);
                let [at, normal] = [point.position_m, point.normal_m2].map(DVec3::from_array);
                all.boxes.entry(all.key(at)).or_default().push([at, normal.normalize_or_zero()]);
            }
        }
        all
    }

    #[allow(clippy::cast_possible_truncation)] // bodies of at most 10 m, balls of at least 0.1 mm
    fn key(&self, at: DVec3) -> [i32; 3] {
        (at / (0.5 * SIGHT * self.radius_m)).floor().to_array().map(|c| c as i32)
    }

    /// Calls back with the points in sight of a centre and their distances.
    fn near(&self, centre_m: DVec3, mut visit: impl FnMut(DVec3, f64)) {
        let [x, y, z] = self.key(centre_m);
        for n in 0..125 {
            let key = [x + n % 5 - 2, y + n / 5 % 5 - 2, z + n / 25 - 2];
            for [at, normal] in self.boxes.get(&key).into_iter().flatten() {
                let away_m = centre_m - *at;
                let [whole, along] = [away_m.length(), away_m.dot(*normal).abs()];
                // Between the points the surface is nearly a plane.
                let beside_m = (whole * whole - along * along).max(0.0).sqrt();
                let distance_m = if beside_m < 0.6 * SPACING * self.radius_m { along } else { whole };
                if distance_m < SIGHT * self.radius_m {
                    visit(*at, distance_m);
                }
            }
        }
    }

    /// Returns the distance of the surface, m, at most as far as the sight.
    fn distance_m(&self, centre_m: DVec3) -> f64 {
        let mut least = SIGHT * self.radius_m;
        self.near(centre_m, |_, distance| least = least.min(distance));
        least
    }

    /// Returns true if the ball nearly reaches a node that does not move: the body does not yield there.
    fn is_held(&self, centre_m: DVec3) -> bool {
        self.fixed_m.iter().any(|at| at.distance(centre_m) < HELD * self.radius_m)
    }

    /// Returns the line of centres through `at_m`.
    fn column(&self, at_m: DVec3) -> Column {
        let mut sum = DVec3::ZERO;
        self.near(at_m, |at, distance| sum += (at_m - at) * (self.radius_m / distance - 1.0).max(0.0));
        let normal = sum.normalize_or(DVec3::Z);
        let reach = |depth_m: f64| {
            let [mut near, mut far] = [-self.distance_m(at_m), 1.2 * self.radius_m];
            for _ in 0..40 {
                let middle = 0.5 * (near + far);
                let is_deeper = self.radius_m - self.distance_m(at_m + normal * middle) > depth_m;
                (near, far) = if is_deeper { (middle, far) } else { (near, middle) };
            }
            at_m + normal * far
        };
        let sample = |depth_m| Sample { centre_m: reach(depth_m), depth_m, ..Sample::default() };
        let samples: Vec<Sample> = DEPTHS.iter().map(|share| sample(share * self.radius_m)).collect();
        // Places where the ball overlaps most; further ones lie in other directions, as the second lip of a groove.
        let middle = samples.get(DEPTHS.len() / 2).map_or(at_m, |sample| sample.centre_m);
        let mut points: Vec<(DVec3, f64)> = Vec::new();
        while points.len() < 3 {
            let limit = points.first().map_or(self.radius_m, |p| self.radius_m - 0.6 * (self.radius_m - p.1));
            let mut best = (middle, limit);
            self.near(middle, |at, distance| {
                let apart = |p: &(DVec3, f64)| (at - middle).dot(p.0 - middle) < 0.5 * distance * p.1;
                if distance < best.1 && points.iter().all(apart) {
                    best = (at, distance);
                }
            });
            if best.1 >= limit {
                break;
            }
            points.push(best);
        }
        let points_m = points.into_iter().map(|p| p.0.to_array()).collect();
        Column { at_m, first_m: reach(0.0), normal, points_m, samples, errors: [f64::NAN; 2] }
    }
}

/// Solves for the contacts of a column, down to one without a solution.
fn press(body: &Condensation, column: &Column, radius_m: f64, grade: f64) -> Result<Column, NotPositive> {
    let mut column = column.clone();
    let Some(deepest) = column.samples.last() else { return Ok(column) };
    let least_m = if column.points_m.len() > 1 { 0.3 } else { 0.54 } * radius_m;
    let grading = Grading { points_m: column.points_m.clone(), least_m, grade };
    let zone = Zone::new(body, &grading, &[deepest.centre_m.to_array()], radius_m)?;
    let mut touch = Touch::default();
    let mut count = 0;
    for sample in &mut column.samples {
        let centre_m = sample.centre_m.to_array();
        let Some(next) = zone.solve(centre_m, radius_m, &touch) else { break };
        touch = next;
        sample.force_n = DVec3::from_array(touch.force_n);
        sample.energy_j = if touch.cells < FEWEST { 0.0 } else { touch.energy_j };
        count += 1;
    }
    column.samples.truncate(count);
    Ok(column)
}

/// Does work on all processors, and returns the results in the order of the list.
fn each<T: Sync, R: Send>(list: &[T], work: impl Fn(&T) -> R + Sync) -> Vec<R> {
    let threads = std::thread::available_parallelism().map_or(1, usize::from).min(list.len());
    let run = |first: usize| list.iter().skip(first).step_by(threads).map(&work).collect::<Vec<R>>();
    let mut parts: Vec<_> = std::thread::scope(|scope| {
        let handles: Vec<_> = (0..threads).map(|first| scope.spawn(move || run(first))).collect();
        handles.into_iter().map(|handle| handle.join().unwrap_or_default().into_iter()).collect()
    });
    (0..list.len()).filter_map(|index| parts[index % threads].next()).collect()
}

/// Survey of a body.
struct Survey<'a> {
    body: &'a Condensation,
    surface: Surface,
    law: Anywhere,
    /// Depth in steps, with the correction of the fit.
    base: Lattice,
    change: Lattice,
    /// Data that hold where nothing is solved.
    weak: Vec<Datum>,
    columns: Vec<Column>,
}

/// Prepares the law of a ball; `hertz`: factor of the energy on a half-space; `grade`: size of elements over the distance from one of
/// so many `places`. Not real-time: minutes.
///
/// # Errors
/// [`NotPositive`] if the parameters do not describe an elastic solid.
pub fn survey(
    mesh: &Mesh,
    body: &Condensation,
    radius_m: f64,
    hertz: f64,
    (places, grade): (usize, f64),
) -> Result<Anywhere, NotPositive> {
    let mut survey = Survey::new(mesh, body, radius_m, hertz);
    while survey.columns.len() < places {
        let next = survey.next(BATCH.min(places - survey.columns.len()));
        if next.is_empty() {
            break;
        }
        survey.add(&next, grade)?;
    }
    survey.estimate();
    Ok(survey.law)
}

/// Marks the points of a lattice that lie in an element of a mesh.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // some hundred points
fn inside(mesh: &Mesh, lattice: &Lattice) -> Vec<bool> {
    let mut is_inside = vec![false; lattice.values.len()];
    let [nx, ny, _] = lattice.counts;
    for element in &mesh.elements {
        let corners = [0, 1, 2, 3].map(|k| DVec3::from_array(mesh.nodes_m[element.nodes[k]]));
        let place = |at: DVec3| (at - DVec3::from_array(lattice.low_m)) / lattice.step_m;
        let low = place(corners.into_iter().fold(corners[0], DVec3::min)).ceil().to_array();
        let high = place(corners.into_iter().fold(corners[0], DVec3::max)).to_array();
        let [x, y, z] = [0, 1, 2].map(|k| low[k] as usize..=high[k] as usize);
        for (k, j) in z.flat_map(|k| y.clone().map(move |j| (k, j))) {
            for index in x.clone().map(|i| (k * ny + j) * nx + i) {
                let at = DVec3::from_array(lattice.place_m(index));
                let [a, b, c, d] = corners.map(|corner| corner - at);
                let volumes = [a.cross(c).dot(b), a.cross(b).dot(d), a.cross(d).dot(c), b.cross(c).dot(d)];
                is_inside[index] |= volumes.iter().all(|v| *v >= 0.0) || volumes.iter().all(|v| *v <= 0.0);
            }
        }
    }
    is_inside
}

impl<'a> Survey<'a> {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // some hundred points; lengths
    fn new(mesh: &Mesh, body: &'a Condensation, radius_m: f64, hertz: f64) -> Self {
        let surface = Surface::new(mesh, radius_m);
        let step_m = STEP * radius_m;
        let nodes = || mesh.nodes_m.iter().map(|at| DVec3::from_array(*at));
        let low = nodes().fold(DVec3::INFINITY, DVec3::min) - (radius_m + 5.0 * step_m);
        let high = nodes().fold(DVec3::NEG_INFINITY, DVec3::max) + (radius_m + 5.0 * step_m);
        let counts = ((high - low) / step_m).to_array().map(|c| c.ceil() as usize + 1);
        let total = counts.iter().product();
        let lattice = Lattice { low_m: low.to_array(), step_m, counts, values: vec![0.0; total] };
        let mut weak = Vec::new();
        let mut depths_m = Vec::with_capacity(total);
        for (index, is_inside) in inside(mesh, &lattice).into_iter().enumerate() {
            let at_m = lattice.place_m(index);
            let distance_m = surface.distance_m(DVec3::from_array(at_m));
            let depth_m = radius_m - if is_inside { -distance_m } else { distance_m };
            let at = [index % counts[0], index / counts[0] % counts[1], index / (counts[0] * counts[1])];
            let (depth, weight) = match depth_m / step_m {
                _ if (0..3).any(|k| at[k] < 3 || at[k] + 3 >= counts[k]) => (-1.5, 1.0),
                depth if is_inside => (depth, 0.02),
                depth if depth < -1.2 => (depth, 0.05),
                _ => (0.0, 0.0),
            };
            if weight > 0.0 {
                weak.push(Datum { at_m, target: Jet::constant(depth), weights: [weight, 0.0] });
            }
            depths_m.push(depth_m as f32);
        }
        let change = lattice.clone();
        let values = depths_m.iter().map(|depth_m| f64::from(*depth_m) / step_m).collect();
        let base = Lattice { values, ..lattice };
        let law = Anywhere { radius_m, hertz, lattice: base.clone(), depths_m, errors: vec![1.0; total] };
        Self { body, surface, law, base, change, weak, columns: Vec::new() }
    }

    /// Returns the next places: the farthest from all known ones, the sooner the more the law erred around them.
    fn next(&self, count: usize) -> Vec<Column> {
        let radius_m = self.law.radius_m;
        let candidates: Vec<DVec3> = (0..self.law.depths_m.len())
            .filter(|&index| (0.3..0.75).contains(&(f64::from(self.law.depths_m[index]) / radius_m)))
            .map(|index| DVec3::from_array(self.law.lattice.place_m(index)))
            .filter(|at| !self.surface.is_held(*at))
            .collect();
        let need = |error: f64| 1.0 + if error.is_finite() { (error / 0.02).min(2.0) } else { 0.0 };
        let known = |c: DVec3| self.columns.iter().map(move |k| c.distance(k.at_m) * need(k.errors[0]));
        let mut far: Vec<f64> = candidates.iter().map(|c| known(*c).fold(1.0e3, f64::min)).collect();
        let mut places = Vec::new();
        while places.len() < count {
            let best = (0..far.len()).fold(0, |best, i| if far[i] > far[best] { i } else { best });
            let Some(&at) = candidates.get(best).filter(|_| far[best] > 0.1 * radius_m) else { break };
            far.iter_mut().zip(&candidates).for_each(|(far, c)| *far = far.min(c.distance(at)));
            places.push(self.surface.column(at));
        }
        places
    }

    /// Solves for new places and fits the law anew.
    fn add(&mut self, places: &[Column], grade: f64) -> Result<(), NotPositive> {
        let solved = each(places, |place| press(self.body, place, self.law.radius_m, grade));
        for column in solved {
            let mut column = column?;
            column.errors[0] = self.error(&column);
            self.columns.push(column);
        }
        let mut data = self.weak.clone();
        self.columns.iter().for_each(|column| self.data(column, &mut data));
        for Datum { at_m, target, .. } in &mut data {
            *target = *target - self.base.at(*at_m);
        }
        self.change.fit(&data);
        let sums = self.base.values.iter().zip(&self.change.values);
        self.law.lattice.values = sums.map(|(base, change)| base + change).collect();
        for index in 0..self.columns.len() {
            self.columns[index].errors[1] = self.error(&self.columns[index]);
        }
        Ok(())
    }

    /// Returns the largest relative error of the force of the law over the contacts of a column.
    fn error(&self, column: &Column) -> f64 {
        let each =
            column.samples.iter().skip(1).take(3).filter(|sample| sample.energy_j > 0.0).map(|sample| {
                let slope = self.law.answer(sample.centre_m.to_array()).energy.slope;
                (DVec3::from_array(slope) + sample.force_n).length() / sample.force_n.length()
            });
        each.fold(0.0, f64::max)
    }

    /// Adds the data of a column.
    fn data(&self, column: &Column, data: &mut Vec<Datum>) {
        let Anywhere { hertz, lattice: Lattice { step_m, .. }, .. } = &self.law;
        let solved = column.samples.iter().filter(|sample| sample.energy_j > 0.0).map(|sample| {
            let value = math::exp(0.4 * math::ln(sample.energy_j / hertz)) / step_m;
            let slope = sample.force_n * (-0.4 * value / sample.energy_j);
            let target = Jet { value, slope: slope.to_array() };
            let weights = [1.5 / value.max(0.2), 1.0];
            (sample, Datum { at_m: sample.centre_m.to_array(), target, weights })
        });
        let (Some(first), Some((last, Datum { target, .. }))) =
            (solved.clone().next(), solved.clone().next_back())
        else {
            return;
        };
        data.extend(solved.map(|s| s.1));
        // The law is zero at first touch, and goes on before and behind.
        let steep = first.1.target.value / (first.0.depth_m / step_m);
        for (depth, weight) in [(0.0, 4.0), (-0.6, 0.5), (-1.5, 0.3)] {
            let at_m = (column.first_m - column.normal * (depth * step_m)).to_array();
            data.push(Datum { at_m, target: Jet::constant(steep * depth), weights: [weight, 0.0] });
        }
        let beyond_m = column.normal * (-0.7 * step_m);
        let value = target.value + beyond_m.dot(DVec3::from_array(target.slope));
        let at_m = (last.centre_m + beyond_m).to_array();
        data.push(Datum { at_m, target: Jet { value, ..target }, weights: [0.2, 0.2] });
    }

    /// Estimates the error at each point of the lattice from the nearest columns.
    #[allow(clippy::cast_possible_truncation)] // at most one
    fn estimate(&mut self) {
        let radius_m = self.law.radius_m;
        let of = |column: &Column| {
            let before = if column.errors[0].is_finite() { column.errors[0] } else { 0.02 };
            let is_solved = column.samples.len() + 1 >= DEPTHS.len();
            if is_solved { OF_MESH + column.errors[1].max(REMAINING * before) } else { 1.0 }
        };
        let apart = |column: &Column| {
            let others = self.columns.iter().map(|other| other.at_m.distance(column.at_m));
            others.filter(|distance| *distance > 0.0).fold(f64::INFINITY, f64::min)
        };
        let known: Vec<(DVec3, f64, f64)> = self.columns.iter().map(|c| (c.at_m, of(c), apart(c))).collect();
        for index in 0..self.law.errors.len() {
            let depth = f64::from(self.law.depths_m[index]) / radius_m;
            let at = DVec3::from_array(self.law.lattice.place_m(index));
            if depth < -2.0 * STEP {
                self.law.errors[index] = 0.0;
            } else if depth < DEEPEST + 2.0 * STEP && !self.surface.is_held(at) {
                let mut near: Vec<_> =
                    known.iter().map(|(c, e, apart)| (c.distance(at), *e, *apart)).collect();
                near.sort_by(|a, b| a.0.total_cmp(&b.0));
                let is_near = near.first().is_some_and(|n| n.0 < 1.2 * n.2 + 0.6 * radius_m);
                let error = near.iter().take(3).map(|n| n.1).fold(0.0, f64::max);
                self.law.errors[index] = if is_near { error as f32 } else { 1.0 };
            }
        }
    }
}
