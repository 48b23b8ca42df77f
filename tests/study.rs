//! scratch
use relens::config;
use relens::evaluate::scenes::Scene;
use relens::evaluate::study::*;
use relens::restoration::method;
#[test]
fn scratch() {
    for cond in [Condition::AsFiled, Condition::NoNoise] {
        let rig =
            config::parse(include_str!("../rig-config/study.toml"), "study.toml", std::path::Path::new("."))
                .unwrap();
        let t = std::time::Instant::now();
        let mut study =
            Study::open(rig, cond).unwrap_or_else(|e| panic!("{}", relens::remedy::full_message(&e)));
        {
            let c = study.stand().calibration();
            println!(
                "calibrated in {:.1} s, {} captures, operator error {:?} norm {:?} noise {:?}",
                t.elapsed().as_secs_f64(),
                c.captures,
                c.operator_error,
                c.norm_squared,
                c.noise
            );
        }
        let mut scores = vec![];
        for scene in [Scene::Astronaut, Scene::Coffee, Scene::Chart] {
            for m in [
                config::Method::Paper,
                config::Method::Residual,
                config::Method::Unmatched,
                config::Method::Digital,
                config::Method::Hybrid,
                config::Method::Wiener,
                config::Method::RichardsonLucy,
            ] {
                let solver = method(study.stand().config(), m);
                let name = solver.name();
                scores.push(study.score(scene, name, &*solver).unwrap());
            }
        }
        println!("{}", table(cond, &scores).markdown());
    }
}
