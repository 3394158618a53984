use super::*;
use crate::preset::Preset;

fn law(preset: Preset, precision: Precision) -> (Spring, Thesis) {
    let (_, _, stiffness) = preset.parameters();
    let spring = preset.spring();
    (spring, Thesis::new(&spring, stiffness, precision))
}

fn at(position_mm: [f64; 3], rotation_rad: [f64; 3]) -> Pose {
    Pose::from_rotation_vector(DVec3::from_array(position_mm) / MM_PER_M, DVec3::from_array(rotation_rad))
}

#[test]
fn vertical_force_drops_to_a_tenth_at_the_printed_buckling_point() {
    // PHYSICS 2.2: spring 1, tilt 0.03 rad and shear 1 mm of the device, F_Y 9.56 -> 0.94 N and M_U -> 0.
    let shear_mm = 25.0 / 15.0;
    for precision in [Precision::Single, Precision::Double] {
        let (spring, law) = law(Preset::Thesis1, precision);
        let buckling_mm = law.buckling_length_m() * MM_PER_M;
        assert!((buckling_mm - 11.183).abs() < 1e-3, "{buckling_mm}");
        let free_mm = spring.geometry().free_length_m * MM_PER_M;
        let at_length = |length_mm: f64| {
            let height_mm = (length_mm * length_mm - shear_mm * shear_mm).sqrt();
            law.respond(&at([shear_mm, 0.0, height_mm - free_mm], [0.0, -0.03, 0.0]), Demand::Wrench)
        };
        let (above, below) = (at_length(buckling_mm + 1e-4), at_length(buckling_mm - 1e-4));
        assert!((above.force_n.z - 9.56).abs() < 0.005, "{}", above.force_n.z);
        assert!((below.force_n.z - 0.94).abs() < 0.005, "{}", below.force_n.z);
        assert!(above.force_n.x.abs() > 0.1 && above.torque_nm.y.abs() > 1e-5);
        assert_eq!((below.force_n.x, below.torque_nm), (0.0, DVec3::ZERO));
        assert_eq!((above.validity, below.validity), (Validity::Ok, Validity::Ok));
    }
}

#[test]
fn window_around_the_free_length_ends_in_a_small_step() {
    // PHYSICS 2.2: at the edge of the window, 1.2e-6 N and 1e-5 N mm.
    let (spring, law) = law(Preset::Thesis1, Precision::Double);
    let free_mm = spring.geometry().free_length_m * MM_PER_M;
    for edge_mm in [WINDOW_MM, -WINDOW_MM] {
        let at_length = |length_mm: f64| {
            let height_mm = (length_mm * length_mm - 1.0).sqrt();
            law.respond(&at([1.0, 0.0, height_mm - free_mm], [0.0, -0.05, 0.0]), Demand::Wrench)
        };
        let sides = [1e-9, -1e-9].map(|offset| at_length(free_mm + edge_mm + offset));
        let step = sides[0].force_n - sides[1].force_n;
        // Across 2e-9 mm the force itself moves by 1e-9 N.
        assert!(step.length() > 1e-8 && step.length() < 2e-6, "{step}");
    }
}

#[test]
fn what_the_printed_code_cannot_compute_is_zero_and_said() {
    for precision in [Precision::Single, Precision::Double] {
        let (_, law) = law(Preset::Thesis1, precision);
        let rest = law.respond(&Pose::HOME, Demand::Wrench);
        assert_eq!((rest.force_n, rest.torque_nm), (DVec3::ZERO, DVec3::ZERO));
        assert_eq!(rest.validity, Validity::OutOfDomain);
        let nothing = Response::none(Validity::OutOfDomain);
        assert_eq!(law.respond(&at([0.0, 0.0, 75.0], [0.0; 3]), Demand::Wrench), nothing, "beyond 3.68 L0");
        assert_eq!(law.respond(&at([0.0, 0.0, 1e300], [0.0; 3]), Demand::Wrench), nothing);
        let invalid = Response::none(Validity::InvalidInput);
        assert_eq!(law.respond(&at([0.0, f64::NAN, 0.0], [0.0; 3]), Demand::Wrench), invalid);
        assert_eq!(law.respond(&at([0.0; 3], [f64::INFINITY, 0.0, 0.0]), Demand::Wrench), invalid);
    }
    // No branch runs for plates in one point when the printed code never buckles.
    let (geometry, material, _) = Preset::Thesis2.parameters();
    let stubby = Geometry { free_length_m: 0.012, wire_diameter_m: 1e-3, ..geometry };
    let spring = Spring::new(stubby, material, Stiffness::Gamma(12.0)).unwrap();
    let law = Thesis::new(&spring, Stiffness::Gamma(12.0), Precision::Double);
    assert!(law.buckling_length_m() < 0.0);
    let touching = law.respond(&at([0.0, 0.0, -12.0], [0.0; 3]), Demand::Wrench);
    assert_eq!(touching, Response::none(Validity::OutOfDomain));
}

#[test]
fn torque_appears_on_demand_only() {
    let (_, law) = law(Preset::Thesis3, Precision::Double);
    for z in [-3.0, 2.0] {
        let pose = at([1.0, -2.0, z], [0.01, 0.02, -0.03]);
        let (force, wrench) = (law.respond(&pose, Demand::Force), law.respond(&pose, Demand::Wrench));
        assert_eq!(force.force_n, wrench.force_n);
        assert_eq!(force.torque_nm, DVec3::ZERO);
        assert!(wrench.torque_nm.x != 0.0 && wrench.torque_nm.y != 0.0);
        assert_eq!(wrench.torque_nm.z, 0.0, "the gain of the yaw is not printed");
    }
}
