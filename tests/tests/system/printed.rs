//! Numbers of the simulated flotor that the book prints: tables of two examples, and what the plugin declares.

use flotor_hal::abi::loader::Setting;
use flotor_session::registry::load_file;
use flotor_simulated::hand::Impedance;
use flotor_simulated::plant::FlotorParameters;
use flotor_tests::TestSize;
use flotor_tests::library::plugin_file;
use flotor_tests::printed::assert_chapter_prints;

#[allow(dead_code)] // times and picture
#[path = "../../examples/integrators.rs"]
mod integrators;
#[allow(dead_code)] // the picture
#[path = "../../examples/velocity_estimators.rs"]
mod velocity_estimators;

const CHAPTER: &str = "simulated-flotor.md";

#[test]
fn the_book_prints_the_errors_of_the_integrators() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    for error in integrators::errors() {
        assert_chapter_prints(CHAPTER, &format!("{},", error.line()));
    }
}

#[test]
fn the_book_prints_noise_and_lag_of_the_velocity_estimates() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    for trade in velocity_estimators::trades().expect("physical parameters") {
        assert_chapter_prints(CHAPTER, &trade.line());
    }
}

#[test]
fn the_book_prints_the_limits_of_the_coils() {
    let plugin = load_file(&plugin_file("flotor-simulated")).unwrap_or_else(|error| panic!("{error}"));
    let settings = [Setting::parse(plugin.parameters(), "preset", "full").expect("the plugin knows it")];
    let mut device = plugin.open_device(&settings).unwrap_or_else(|error| panic!("{error}"));
    let limits = device.capabilities().expect("it declares them");
    let [force, torque] = [limits.max_force_n, limits.max_torque_nm]
        .map(|most| (most.into_iter().fold(f64::INFINITY, f64::min), most.into_iter().fold(0.0, f64::max)));
    let text =
        format!("they give {:.1} to {:.1} N and {:.2} to {:.2} N·m", force.0, force.1, torque.0, torque.1);
    assert_chapter_prints(CHAPTER, &text);
}

#[test]
fn the_book_prints_the_hands_and_the_flotor() {
    for (grip, hand) in [("firm", Impedance::FIRM), ("relaxed", Impedance::RELAXED)] {
        let Impedance { mass_kg, damping_ns_per_m, stiffness_n_per_m, .. } = hand;
        let row = format!(
            "| `{grip}` | {mass_kg} kg | {} N·s/m | {} N/m |",
            damping_ns_per_m.x, stiffness_n_per_m.x
        );
        assert_chapter_prints(CHAPTER, &row);
    }
    let [thesis, utah] = [FlotorParameters::THESIS, FlotorParameters::UTAH];
    let inertia = (thesis.inertia_kg_m2 * 1.0e3).to_array().map(|moment| moment.to_string()).join(", ");
    let drag = thesis.drag;
    for row in [
        format!(
            "| mass | {:.3} kg (`flotor = \"thesis\"`), {:.3} kg (`utah`) |",
            thesis.mass_kg, utah.mass_kg
        ),
        format!("| centre of mass | {} mm below the origin |", -thesis.centre_of_mass_m.z * 1.0e3),
        format!("| moments of inertia | {inertia} g·m² |"),
        format!(
            "| drag | {} N·s/m, {} N·m·s/rad |",
            drag.translational_ns_per_m, drag.rotational_nms_per_rad
        ),
    ] {
        assert_chapter_prints(CHAPTER, &row);
    }
}
