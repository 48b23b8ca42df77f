//! The timing measured by `relens check` suffices for a calibration.

use relens::measurement::{calibrate, to_the_end};
use relens::rig::simulated;
use relens::{config, diagnosis};

#[test]
#[ignore = "a minute: the gate runs it"]
fn the_settle_time_proposed_by_check_calibrates_as_well_as_a_long_one() {
    for (latency, response) in [(2, 5.0), (6, 20.0)] {
        let text = include_str!("../../rig-config/small.toml")
            .replacen("latency-refreshes = 2", &format!("latency-refreshes = {latency}"), 1)
            .replacen("response-ms = 5.0", &format!("response-ms = {response:.1}"), 1);
        let mut file = config::parse(&text, "small.toml").unwrap();
        file.panel.settle_ms = 10.0;
        let mut devices = simulated::open(&diagnosis::patient(&file)).unwrap().0;
        let timing = diagnosis::measure(&mut devices, &file).unwrap();
        let error_with = |settle_ms: f64| {
            let mut file = file.clone();
            file.panel.settle_ms = settle_ms;
            let mut devices = simulated::open(&file).unwrap().0;
            let made = calibrate(&mut devices, &file, None, &mut to_the_end);
            made.unwrap_or_else(|e| panic!("{settle_ms} ms: {e}")).operator_error
        };
        let (proposed, long) = (error_with(timing.settle_to_write_ms()), error_with(1000.0));
        println!("{latency} refreshes, {response} ms: {timing}{proposed:?} for {long:?}");
        assert!(
            proposed.iter().zip(long).all(|(proposed, long)| *proposed < 1.05 * long),
            "{timing}"
        );
    }
}
