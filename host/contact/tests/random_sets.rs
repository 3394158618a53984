//! The solver against a slow generic one, on random sets of contacts.

mod common;

use common::reference::Reference;
use common::{Case, PERIOD_S, cases, unlimited};
use flotor_contact::{Outcome, Replacement, Solver};

#[test]
fn forces_are_those_of_a_generic_convex_solver() {
    let count = cases(1_000, 100_000);
    let (mut ticks, mut within, mut largest, mut worst_residual) = (0_u32, 0_u32, 0.0_f64, 0.0_f64);
    let mut histogram = [0_u32; 41];
    for seed in 0..u64::try_from(count).expect("small") {
        let case = Case::new(seed);
        let mut reference = Reference::new(&case);
        let mut solver = Solver::new(case.coupling, unlimited(), Replacement::Immediate, PERIOD_S)
            .expect("a period above 0");
        solver.replace(&case.set());
        for (pose, twist, age_s) in &case.ticks {
            let answer = reference.tick(pose, twist, *age_s, PERIOD_S);
            let solution = solver.solve(pose, twist, *age_s);
            assert_eq!(solution.outcome, Outcome::Solved, "case {seed}: {} steps", solution.steps);
            let force = (solution.wrench.force() - answer.force).length();
            let torque = (solution.wrench.torque() - answer.torque).length();
            let difference = force.max(torque);
            ticks += 1;
            within += u32::from(difference <= 1.0e-9);
            largest = largest.max(difference);
            worst_residual = worst_residual.max(answer.residual);
            if solver.excess() > 1.0 {
                histogram[usize::try_from(solution.steps).expect("small")] += 1;
            }
        }
    }
    println!(
        "{ticks} ticks: {within} within 1e-9 N, largest difference {largest:e} N; residual {worst_residual:e}"
    );
    for (steps, count) in histogram.iter().enumerate().filter(|(_, count)| **count > 0) {
        println!("{steps:3} Newton steps: {count}");
    }
    assert!(f64::from(ticks - within) <= 0.001 * f64::from(ticks), "{within} of {ticks} within 1e-9 N");
    assert!(largest <= 1.0e-6, "{largest:e} N");
}
