//! Frames identified by their marks on a small simulated rig, with faults and slow panels.

use super::*;
use crate::config;
use crate::frame::{Channel, Plane, Size};
use crate::rig::simulated;

/// The smallest rig on which marks are readable, of 160 × 128 sensor pixels.
fn tiny(change: impl Fn(&str) -> String) -> (Devices, simulated::Witness, config::RigFile) {
    let mut text = include_str!("../../rig-config/small.toml").to_owned();
    for (from, to) in [
        ("width-px = 256", "width-px = 120"),
        ("height-px = 192", "height-px = 88"),
        ("width-px = 480", "width-px = 240"),
        ("height-px = 270", "height-px = 180"),
        ("width-px = 288", "width-px = 160"),
        ("height-px = 224", "height-px = 128"),
        // A narrower blur, traced at fewer points: the lens is not what is tested.
        ("pixel-pitch-um = 40.0", "pixel-pitch-um = 72.0"),
        ("\nsupport-px = 19", "\nsupport-px = 11"),
        ("node-columns = 16", "node-columns = 4"),
        ("margin-px = 8", "margin-px = 8\n\n[marks]\nfrom-edge-px = 2\nheight-px = 6"),
    ] {
        assert!(text.contains(from), "{from}");
        text = text.replacen(from, to, 1);
    }
    let rig = config::parse(&change(&text), "tiny.toml").unwrap_or_else(|e| panic!("{e}"));
    let (mut devices, witness) = simulated::open(&rig).unwrap_or_else(|e| panic!("{e}"));
    devices.timing.exposures_max = 40;
    (devices, witness, rig)
}

fn with_marks(change: impl Fn(&str) -> String) -> Devices {
    let (mut devices, _, rig) = tiny(change);
    devices
        .find_marks(MarkPlace::of(&rig).expect("it has marks"))
        .unwrap_or_else(|e| panic!("{e}"));
    devices
}

fn five_percent_of_each(text: &str) -> String {
    format!("{text}\n[faults]\nstale = 0.05\nduplicate = 0.05\nmissing = 0.05\nmixed = 0.05\n")
}

/// One of five pictures that a frame's mean identifies.
fn grey(n: usize) -> Codes {
    Codes::filled(Size::new(240, 180), [40, 90, 130, 170, 210][n % 5])
}

/// Means of the middle third and the thirds above and below, which reveal mixtures.
fn levels(exposed: &Exposed) -> [f64; 3] {
    let plane = exposed.counts.plane(Channel::Green);
    let mean = |from: usize, to: usize| {
        let rows = (from..to).flat_map(|y| plane.row(y).iter());
        rows.map(|&c| f64::from(c)).sum::<f64>() / ((to - from) * plane.width()) as f64
    };
    [mean(20, 44), mean(52, 76), mean(84, 108)]
}

/// Levels of the five greys on a rig without faults.
fn references() -> Vec<[f64; 3]> {
    let mut sound = with_marks(str::to_owned);
    (0..5).map(|n| levels(&sound.capture(&grey(n)).unwrap_or_else(|e| panic!("{e}")))).collect()
}

fn is_of(exposed: &Exposed, reference: &[f64; 3]) -> bool {
    levels(exposed).iter().zip(reference).all(|(found, want)| (found - want).abs() < 0.03 * want)
}

/// About thirty faults of each kind in 600 captures; `RELENS_CAPTURES=10000` makes more.
#[test]
fn no_wrong_frame_is_accepted_under_faults() {
    let asked = std::env::var("RELENS_CAPTURES").ok().and_then(|count| count.parse().ok());
    let captures = asked.unwrap_or(600usize);
    let references = references();
    let mut rig = with_marks(five_percent_of_each);
    // The search for marks ran under the same faults.
    for n in 0..captures {
        let exposed = rig.capture(&grey(n)).unwrap_or_else(|e| panic!("capture {n}: {e}"));
        assert!(is_of(&exposed, &references[n % 5]), "capture {n} is of another picture");
    }
    let rejected = rig.rejected();
    // Each kind of fault occurs about once in twenty captures.
    for (kind, times) in [
        ("missing", rejected.missing),
        ("repeated", rejected.repeated),
        ("of another picture", rejected.another),
        ("mixed", rejected.mixed),
    ] {
        assert!(times > captures as u64 / 50, "only {times} {kind}: {rejected:?}");
    }
}

#[test]
fn without_marks_the_same_faults_give_wrong_frames() {
    let references = references();
    let (mut rig, ..) = tiny(five_percent_of_each);
    let wrong = (0..500)
        .filter(|&n| {
            rig.capture(&grey(n)).is_ok_and(|exposed| !is_of(&exposed, &references[n % 5]))
        })
        .count();
    assert!(wrong > 10, "{wrong} of 500: the test above would pass without marks");
}

/// An ordinary panel of 60 Hz with two refreshes of latency, settled to half a grey level within
/// three and a half refreshes.
fn quick(text: &str) -> String {
    let text = text.replacen("settle-ms = 100.0", "settle-ms = 48.0", 1);
    text.replacen("response-ms = 5.0", "response-ms = 2.5", 1)
}

#[test]
fn a_dependent_capture_takes_at_most_an_eighth_of_a_second() {
    let mut rig =
        with_marks(|text| quick(text).replacen("exposure-ms = 50.0", "exposure-ms = 16.666667", 1));
    let begin = rig.seconds();
    for n in 0..40 {
        rig.capture(&grey(n)).unwrap_or_else(|e| panic!("{e}"));
    }
    let each_s = (rig.seconds() - begin) / 40.0;
    assert!(each_s <= 0.12, "{:.1} ms", each_s * 1e3);
}

#[test]
fn a_panel_slower_than_its_settle_time_is_detected() {
    // The panel is still changing, so that the frame is a blend of two pictures.
    let mut rig = with_marks(str::to_owned);
    rig.timing.settle_ms = 25.0;
    rig.timing.exposures_max = 1;
    let failed = (0..20).filter(|&n| rig.capture(&grey(n)).is_err()).count();
    assert_eq!(failed, 20);
}

/// The tiny rig with vanishing marks in rows of the photo.
fn vanishing(text: &str) -> String {
    let text = text.replacen("height-px = 6", "height-px = 6\nvanish = true", 1);
    text.replacen("height-px = 88", "height-px = 112", 1)
}

/// A picture whose rows all differ.
fn uneven() -> Codes {
    let code = |x: usize, y: usize| (60 + (x * 7 + y * 5) % 120) as u8;
    Codes::from_planes([0; 3].map(|_| Plane::from_fn(Size::new(240, 180), code)))
}

/// Mean counts of green of each row.
fn rows(exposed: &Exposed) -> Vec<f64> {
    let plane = exposed.counts.plane(Channel::Green);
    let mean = |y| plane.row(y).iter().map(|&c| f64::from(c)).sum::<f64>() / 160.0;
    (0..plane.height()).map(mean).collect()
}

#[test]
fn vanished_marks_leave_no_trace_whatever_the_faults() {
    let (mut plain, ..) = tiny(vanishing);
    let capture =
        |devices: &mut Devices| rows(&devices.capture(&uneven()).unwrap_or_else(|e| panic!("{e}")));
    let wanted = capture(&mut plain);
    let mut marked = with_marks(vanishing);
    let before = marked.captures();
    capture(&mut marked);
    assert_eq!(marked.captures() - before, 2);
    // Another exposure shows no mark either.
    let again = rows(&marked.expose().unwrap_or_else(|e| panic!("{e}")));
    let even = |found: &[f64]| {
        for (y, (found, wanted)) in found.iter().zip(&wanted).enumerate() {
            assert!((found / wanted - 1.0).abs() < 0.04, "row {y}: {found:.1}, not {wanted:.1}");
        }
    };
    even(&again);
    let mut faulty = with_marks(|text| five_percent_of_each(&vanishing(text)));
    for n in 0..200 {
        // Shows another picture in between, in case a late frame arrives.
        faulty.capture(&grey(n)).unwrap_or_else(|e| panic!("{e}"));
        even(&capture(&mut faulty));
    }
    let rejected = faulty.rejected();
    assert!(rejected.another > 10 && rejected.mixed > 5, "{rejected:?}");
    // With permanent strips, the same rows show marks or black.
    let hidden = capture(&mut with_marks(str::to_owned));
    assert!(hidden[9] < 0.8 * wanted[9], "{:.1} and {:.1}", hidden[9], wanted[9]);
}

/// Pictures that resemble marks: greys, noise, bars and squares up to a cell's width, shifted.
fn pictures() -> Vec<Codes> {
    let codes = |of: &dyn Fn(usize, usize) -> u8| {
        Codes::from_planes([0; 3].map(|_| Plane::from_fn(Size::new(240, 180), of)))
    };
    let mut pictures: Vec<Codes> =
        [0, 8, 40, 128, 255].map(|code| codes(&|_, _| code)).into_iter().collect();
    pictures.push(uneven());
    pictures
        .push(codes(&|x, y| ((x * 2_654_435_761) ^ (y * 40_503 * 97)).wrapping_mul(0x9e37) as u8));
    for (width, at) in [(3, 0), (5, 2), (7, 0), (7, 3), (7, 5), (11, 4), (14, 0), (14, 7), (40, 9)]
    {
        let light = |on: bool| if on { 255 } else { 0 };
        pictures.push(codes(&|x, _| light((x + at) / width % 2 == 0)));
        pictures.push(codes(&|x, y| light(((x + at) / width + (y + at) / width) % 2 == 0)));
    }
    pictures
}

#[test]
#[ignore = "minutes: the long gate runs it"]
fn remains_of_a_mark_distinguish_frames_with_it_from_frames_without_it() {
    type Changed = fn(&str) -> String;
    let rigs: [(&str, Changed); 6] = [
        ("as it is", vanishing),
        ("glare", |text| {
            let glare = "node-columns = 4\nglare-share = 0.1\nglare-radius-px = 8.0";
            let own: Vec<&str> = text.lines().filter(|line| !line.starts_with("glare-")).collect();
            vanishing(&own.join("\n").replacen("node-columns = 4", glare, 1))
        }),
        ("sharp", |text| {
            vanishing(&text.replacen("pixel-pitch-um = 72.0", "pixel-pitch-um = 200.0", 1))
        }),
        ("noise", |text| {
            let noisy =
                text.replacen("full-well-electrons = 42000.0", "full-well-electrons = 2000.0", 1);
            vanishing(&noisy.replacen("read-noise-levels = 0.2", "read-noise-levels = 2.0", 1))
        }),
        ("gamma 1.8", |text| vanishing(&text.replacen("[2.25, 2.2, 2.15]", "[1.8, 1.8, 1.8]", 1))),
        ("gamma 2.6", |text| vanishing(&text.replacen("[2.25, 2.2, 2.15]", "[2.6, 2.6, 2.6]", 1))),
    ];
    for (name, change) in rigs {
        let mut rig = with_marks(change);
        let (mut gone, mut stale) = (Vec::new(), Vec::new());
        for codes in pictures() {
            for _ in 0..8 {
                let exposed = rig.shoot(&codes).unwrap_or_else(|e| panic!("{e}"));
                let marks = rig.marks.as_ref().expect("it has marks");
                let (number, own) = (rig.number, marks.own_shares(&codes, rig.number));
                let least = marks.remains(&exposed.counts, number, &own).fold(-9.0, f32::max);
                stale.push(least);
                rig.panel.show(&codes).unwrap_or_else(|e| panic!("{e}"));
                let later = rig.clock.now();
                rig.clock.wait_until(after(later, 100.0));
                let bare = rig.expose().unwrap_or_else(|e| panic!("{e}"));
                let marks = rig.marks.as_ref().expect("it has marks");
                gone.push(marks.remains(&bare.counts, number, &own).fold(-9.0, f32::max));
            }
        }
        gone.sort_by(f32::total_cmp);
        stale.sort_by(f32::total_cmp);
        let (most, least) = (gone[gone.len() - 1], stale[0]);
        println!("{name}: gone up to {most:.3}; with the mark from {least:.3}");
        assert!(most < 0.2 && least > 0.9, "{name}: {most} and {least}");
    }
}

#[test]
fn a_panel_out_of_view_has_no_marks() {
    let (mut devices, _, rig) =
        tiny(|text| text.replacen("shift-x-px = ", "shift-x-px = 1000.0 # ", 1));
    let place = MarkPlace::of(&rig).expect("it has marks");
    assert!(matches!(devices.find_marks(place), Err(RigError::NoMarks { .. })));
    let dark =
        devices.capture(&Codes::from_planes([0; 3].map(|_| Plane::filled(Size::new(240, 180), 0))));
    assert!(dark.is_ok(), "the devices themselves are well");
}
