//! The mesh against shapes that are known exactly.

use super::*;
use flotor_hal::glam::DVec2;
use flotor_hal::{CenterlineInfo, DQuat, DVec3, Pose, orientation_from_rotation_vector};
use proptest::prelude::*;
use std::f64::consts::TAU;

/// Spring 1 of the thesis, m.
const FREE_LENGTH_M: f64 = 25.0e-3;
const WIRE_RADIUS_M: f64 = 0.315e-3;
const COIL_RADIUS_M: f64 = 3.035e-3;
const TURNS: f64 = 11.8;
const SECTIONS: usize = 65;

fn info() -> CenterlineInfo {
    CenterlineInfo::coil(WIRE_RADIUS_M, COIL_RADIUS_M, TURNS, COIL_RADIUS_M + WIRE_RADIUS_M)
}

/// A centreline known in closed form: bent to an arc, sheared to an S, twisted, shortened.
#[derive(Clone, Copy, Debug)]
struct Exact {
    length_m: f64,
    bend_rad: f64,
    sway_m: f64,
    twist_rad: f64,
}

impl Exact {
    const REST: Exact = Exact { length_m: FREE_LENGTH_M, bend_rad: 0.0, sway_m: 0.0, twist_rad: 0.0 };

    fn section(&self, s: f64) -> Section {
        let angle = self.bend_rad * s;
        let along = DVec3::new(
            if self.bend_rad == 0.0 { 0.0 } else { self.length_m / self.bend_rad * (1.0 - angle.cos()) },
            self.sway_m * (3.0 * s * s - 2.0 * s * s * s),
            if self.bend_rad == 0.0 {
                self.length_m * s
            } else {
                self.length_m / self.bend_rad * angle.sin()
            },
        );
        let bend = orientation_from_rotation_vector(DVec3::Y * angle);
        let center_m = DVec3::new(0.0, 0.0, -FREE_LENGTH_M) + along;
        Section { center_m, orientation: bend * DQuat::from_rotation_z(self.twist_rad * s) }
    }

    fn reported(&self) -> Vec<Pose> {
        let place = |i: usize| i as f64 / (SECTIONS - 1) as f64;
        let pose = |section: Section| Pose::new(section.center_m, section.orientation);
        (0..SECTIONS).map(|i| pose(self.section(place(i)))).collect()
    }

    fn wire_center(&self, s: f64) -> DVec3 {
        let section = self.section(s);
        let fibre = DVec2::from_angle(TAU * TURNS * s) * COIL_RADIUS_M;
        section.center_m + section.orientation * fibre.extend(0.0)
    }
}

fn any_shape() -> impl Strategy<Value = Exact> {
    // The whole workspace of the handle and beyond: half to one and a half lengths, 60 degrees, 10 mm aside.
    (0.5..1.5, -1.05..1.05, -0.01..0.01, -1.0..1.0).prop_map(|(scale, bend_rad, sway_m, twist_rad)| Exact {
        length_m: scale * FREE_LENGTH_M,
        bend_rad,
        sway_m,
        twist_rad,
    })
}

fn body() -> Body {
    Body::new(info(), &Exact::REST.reported()).unwrap()
}

fn mesh_of(exact: &Exact, detail: Detail) -> (Mesh, Curve) {
    let (body, curve) = (body(), Curve::through(&exact.reported()).unwrap());
    let strain = Strain::between(&body.rest, &curve);
    let mut mesh = Mesh::default();
    append_tube(&mut mesh, &body, &curve, &strain, detail, |_| [0; 4]);
    (mesh, curve)
}

fn position_m(vertex: &Vertex) -> DVec3 {
    DVec3::from_array(vertex.position_mm.map(f64::from)) / MM_PER_M
}

/// Distance of a point from the exact centre of the wire near the fraction `s`, by refining the nearest place.
fn distance_from_wire(exact: &Exact, point_m: DVec3, s: f64) -> f64 {
    let distance = |s: f64| (exact.wire_center(s.clamp(0.0, 1.0)) - point_m).length();
    let (mut best, mut width) = (s, 0.05 / TURNS);
    while width > 1.0e-9 {
        let nearest = (-5..=5).map(|i| best + width * f64::from(i) / 5.0);
        best = nearest.min_by(|a, b| distance(*a).total_cmp(&distance(*b))).unwrap();
        width *= 0.4;
    }
    distance(best)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    /// The surface is that of the exact helix within a thousandth of the wire's diameter.
    #[test]
    fn tube_lies_on_the_exact_helix(exact in any_shape()) {
        let detail = Detail { rings: 400, sides: 12 };
        let (mesh, _) = mesh_of(&exact, detail);
        for ring in (3..detail.rings - 3).step_by(13) {
            let s = ring as f64 / (detail.rings - 1) as f64;
            for vertex in &mesh.vertices[ring * detail.sides..(ring + 1) * detail.sides] {
                let error_m = (distance_from_wire(&exact, position_m(vertex), s) - WIRE_RADIUS_M).abs();
                prop_assert!(error_m < 1.0e-3 * 2.0 * WIRE_RADIUS_M, "{error_m} m at {s}");
            }
        }
    }

    /// Both ends of the wire lie in the plane of their plate, inside its rim, and the plates are where the model
    /// says its ends are.
    #[test]
    fn plates_meet_the_tube(exact in any_shape()) {
        let (mesh, curve) = mesh_of(&exact, Detail { rings: 400, sides: 12 });
        for (s, first_ring, outward) in [(0.0, 0, -1.0), (1.0, 399, 1.0)] {
            let section = curve.section(s);
            prop_assert!((section.center_m - exact.section(s).center_m).length() < 1.0e-12);
            let ring = &mesh.vertices[first_ring * 12..(first_ring + 1) * 12];
            let center_m: DVec3 = ring.iter().map(position_m).sum::<DVec3>() / 12.0;
            let local = section.orientation.conjugate() * (center_m - section.center_m);
            prop_assert!(local.z.abs() < 1.0e-3 * 2.0 * WIRE_RADIUS_M, "{} m off the plate", local.z);
            prop_assert!(local.truncate().length() < info().plate_radius_m);

            let mut disc = Mesh::default();
            plate(&mut disc, &section, info().plate_radius_m, 1.0e-3, outward, [0; 4]);
            let heights = disc.vertices.iter().map(|vertex| {
                (section.orientation.conjugate() * (position_m(vertex) - section.center_m)).z * outward
            });
            let (low, high) = heights.fold((f64::MAX, f64::MIN), |(low, high), z| (low.min(z), high.max(z)));
            // Rounding of f32 at 25 mm.
            prop_assert!(low.abs() < 1.0e-8 && (high - 1.0e-3).abs() < 1.0e-8, "{low} to {high}");
        }
    }
}

/// Volume inside a closed mesh by the divergence theorem; negative if it is inside out.
fn volume_m3(mesh: &Mesh) -> f64 {
    let corner = |index: u32| position_m(&mesh.vertices[index as usize]);
    let triangles = mesh.indices.chunks_exact(3);
    triangles.map(|t| corner(t[0]).dot(corner(t[1]).cross(corner(t[2]))) / 6.0).sum()
}

#[test]
fn the_wire_is_closed_and_right_side_out() {
    let detail = Detail { rings: 1200, sides: 24 };
    let (mesh, _) = mesh_of(&Exact::REST, detail);
    // Pappus: cross-section times length of the wire; a polygon of n sides has n/2 sin(2 pi/n) of its circle's r².
    let pitch_m = FREE_LENGTH_M / TURNS;
    let wire_m = TURNS * (TAU * COIL_RADIUS_M).hypot(pitch_m);
    let section_m2 = 0.5 * 24.0 * (TAU / 24.0).sin() * WIRE_RADIUS_M.powi(2);
    let error = volume_m3(&mesh) / (section_m2 * wire_m) - 1.0;
    // A chord of the angle 2 a is shorter than its arc by a²/6, and the rings at its ends stand on it at the angle a,
    // which takes another a²/2. Next come terms of fourth order and the pitch, both below a hundredth of that.
    let half_chord = std::f64::consts::PI * TURNS / (detail.rings - 1) as f64;
    let expected = -2.0 / 3.0 * half_chord.powi(2);
    assert!((error / expected - 1.0).abs() < 0.02, "{error} for {expected}");
}

#[test]
fn plates_and_arrows_are_closed_and_right_side_out() {
    let mut disc = Mesh::default();
    let section = Section { center_m: DVec3::ZERO, orientation: DQuat::IDENTITY };
    plate(&mut disc, &section, 4.0e-3, 1.0e-3, 1.0, [0; 4]);
    let full = std::f64::consts::PI * 16.0e-6 * 1.0e-3;
    assert!((0.9 * full..full).contains(&volume_m3(&disc)), "{}", volume_m3(&disc));

    let mut arrow = Mesh::default();
    force_arrow(&mut arrow, DVec3::ZERO, DVec3::new(0.0, 3.0e-3, -20.0e-3), 0.5e-3, [0; 4]);
    assert!(volume_m3(&arrow) > 0.0);
    let tip = arrow.vertices.iter().map(position_m).min_by(|a, b| a.z.total_cmp(&b.z)).unwrap();
    assert!((tip - DVec3::new(0.0, 3.0e-3, -20.0e-3)).length() < 1.0e-7, "the tip is at {tip}");
}

#[test]
fn normals_point_away_from_the_wire() {
    let (mesh, _) = mesh_of(&Exact { bend_rad: 0.7, ..Exact::REST }, Detail { rings: 300, sides: 10 });
    for triangle in mesh.indices.chunks_exact(3) {
        let [a, b, c] = [0, 1, 2].map(|k| mesh.vertices[triangle[k] as usize]);
        let face = (position_m(&b) - position_m(&a)).cross(position_m(&c) - position_m(&a));
        let normal = DVec3::from_array(a.normal.map(f64::from));
        assert!((normal.length() - 1.0).abs() < 1.0e-5 && face.dot(normal) > 0.0);
    }
}

#[test]
fn strain_of_known_shapes() {
    let rest = Curve::through(&Exact::REST.reported()).unwrap();
    let strain = |exact: Exact| Strain::between(&rest, &Curve::through(&exact.reported()).unwrap());
    // Compression by a fifth is a strain of -0.2 everywhere.
    let short = strain(Exact { length_m: 0.8 * FREE_LENGTH_M, ..Exact::REST });
    assert!((short.at(0.3, DVec2::ZERO).axial + 0.2).abs() < 1.0e-9);
    // An arc about y: fibres at +x are on the inside and shortened by curvature times distance.
    let bent = strain(Exact { bend_rad: 0.5, ..Exact::REST });
    let inside = bent.at(0.5, DVec2::new(COIL_RADIUS_M, 0.0)).axial;
    let expected = -0.5 / FREE_LENGTH_M * COIL_RADIUS_M;
    // Chords of 1/64 of half a radian: relative 2e-6.
    assert!((inside / expected - 1.0).abs() < 1.0e-4, "{inside} for {expected}");
    assert!(bent.at(0.5, DVec2::ZERO).magnitude() < 1.0e-5);
}

#[test]
fn detail_follows_size_and_stays_within_sense() {
    let body = body();
    let [tiny, usual, huge] = [0.1, 12.0, 1.0e6].map(|scale| Detail::for_size(&body, scale));
    assert!(tiny.rings < usual.rings && usual.rings < huge.rings && huge.rings <= 6001);
    assert!(tiny.sides < usual.sides && usual.sides <= huge.sides);
    assert_eq!(Detail::for_size(&body, f64::NAN).sides, tiny.sides, "no size, least detail");
    // At the usual size no chord of a ring is more than a quarter of a pixel inside its arc.
    let sag_px = WIRE_RADIUS_M * MM_PER_M * 12.0 * (std::f64::consts::PI / usual.sides as f64).powi(2) / 2.0;
    assert!(sag_px < 0.25, "{sag_px}");
}

#[test]
fn nonsense_has_no_shape() {
    let mut poses = Exact::REST.reported();
    assert!(Curve::through(&poses[..3]).is_none());
    poses[7].position_m[1] = f64::NAN;
    assert!(Curve::through(&poses).is_none());
    let thick = CenterlineInfo::coil(f64::INFINITY, 1.0, 1.0, 1.0);
    assert!(Body::new(thick, &Exact::REST.reported()).is_none());
    assert!(Body::new(info(), &[Pose::HOME; 65]).is_none(), "a body without length");
}

#[test]
fn turns_touch_where_the_pitch_is_the_wire() {
    let contact = contact_strain(&body()).unwrap();
    assert!((contact - (0.63e-3 / (FREE_LENGTH_M / TURNS) - 1.0)).abs() < 1.0e-9, "{contact}");
    let tube = Body::new(CenterlineInfo::coil(1.0e-3, 0.0, 0.0, 0.0), &Exact::REST.reported()).unwrap();
    assert_eq!(contact_strain(&tube), None);
}
