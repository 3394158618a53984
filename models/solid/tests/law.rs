
use crate::anywhere::{body, mesh};
use crate::table::rows;
#[test]
#[ignore]
fn experiment() {
    let name = std::env::var("BODY").unwrap();
    let file = std::env::var("TABLE").unwrap();
    let places: usize = std::env::var("PLACES").unwrap().parse().unwrap();
    let m = mesh(&name);
    let b = body(&name, 0.3, 1.0);
    let r: f64 = std::env::var("R").unwrap().parse().unwrap();
    let hertz = 8.0 / 15.0 / (1.0 - 0.09) * r.sqrt();
    let t = std::time::Instant::now();
    let law = flotor_solid::survey::survey(&m, &b, r, hertz, (places, 0.7)).unwrap();
    println!("took {:.1}", t.elapsed().as_secs_f64());
    let unseen: usize = std::env::var("UNSEEN").unwrap().parse().unwrap();
    let mut seed = 12345u64;
    let mut next = || { seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407); (seed >> 33) as f64 / (1u64 << 31) as f64 };
    let mut n = 0;
    while n < unseen {
        let c = [0, 1, 2].map(|k| law.lattice.low_m[k] + next() * law.lattice.step_m * law.lattice.counts[k] as f64);
        let a = law.answer(c);
        if a.depth_m < 0.1 * r || !a.is_in_domain(r) { continue; }
        n += 1;
        let mut zone = None;
        let dir = flotor_hal::DVec3::from_array(a.energy.slope).normalize();
        let place = (flotor_hal::DVec3::from_array(c) + dir * (r - a.depth_m)).to_array();
        for least in [0.35] {
            let grading = flotor_solid::refinement::Grading { points_m: { let mut p = vec![place]; if name == "groove" { for x in [-0.01, 0.01] { let l = [x, c[1].clamp(-0.03, 0.03), 0.0]; if (flotor_hal::DVec3::from_array(l) - flotor_hal::DVec3::from_array(c)).length() < r { p.push(l); } } } p }, least_m: least * (r * a.depth_m).sqrt(), grade: 0.6 };
            zone = Some(flotor_solid::touch::Zone::new(&b, &grading, &[c], r).unwrap());
        }
        let touch = zone.unwrap().solve(c, r, &flotor_solid::touch::Touch::default()).unwrap();
        let e = flotor_hal::DVec3::from_array(touch.force_n);
        let f = -flotor_hal::DVec3::from_array(a.energy.slope);
        println!("U {:.1} {:.1} {:.1} depth {:.2} err {:.4} along {:+.4} est {:.4} cells {}", c[0]*1e3, c[1]*1e3, c[2]*1e3, a.depth_m*1e3, (f - e).length() / e.length(), f.length() / e.length() - 1.0, a.error, touch.cells);
    }
    for row in rows(&file) {
        if row.number("radius_m") != r || row.number("nu") != 0.3 { continue; }
        let c = row.vector(["cx_m", "cy_m", "cz_m"]).to_array();
        let a = law.answer(c);
        let f = flotor_hal::DVec3::from_array(a.energy.slope) * -row.number("E_pa");
        let e = row.vector(["fx_n", "fy_n", "fz_n"]);
        println!("{} {} depth {:.2} {:.2} err {:.4} est {:.4} {}", row.text("id"), row.text("category"), row.number("depth_m")*1e3, a.depth_m*1e3, (f - e).length() / e.length(), a.error, a.is_in_domain(r));
    }
}
