//! PWM channels as the kernel offers them, each rule broken in turn, and the line behind them.

use std::os::unix::fs::symlink;
use std::sync::{Arc, Mutex};

use super::*;

const CHIP: &str = "1f00098000.pwm";
const PULSE_US: u32 = 50_000;
/// Tolerance of time stamps where marks identify frames (`STAMP_ERROR_MS` of the exposure).
const GRACE_S: f64 = 2e-3;

/// Behaviour of a chip.
#[derive(Clone, Copy, Default)]
struct PwmRules {
    /// Share of the period that has passed when a channel is enabled.
    starts_at: f64,
    /// Settings take effect at the end of a period, even those of a disabled channel.
    is_lazy: bool,
    /// The kernel uses the channel itself.
    taken: bool,
    /// Moment at which udev opens a new channel to its group.
    opened_at_s: f64,
    /// Files cannot be written in the service.
    read_only: bool,
    /// The chip has one polarity only.
    upright: bool,
    /// Longest period of the chip.
    period_max_ns: Option<u64>,
}

/// A period, and the pulse at its beginning.
#[derive(Clone, Copy)]
struct Wave {
    period_s: f64,
    pulse_s: f64,
}

/// A run of pulses between enabling and disabling.
#[derive(Clone, Copy)]
struct PulseRun {
    from_s: f64,
    until_s: f64,
    /// Start of the period under way at the beginning.
    began_s: f64,
    /// The first period, and those after it.
    waves: [Wave; 2],
}

impl PulseRun {
    /// Starts and ends of the active level.
    fn pulses(self) -> impl Iterator<Item = (f64, f64)> {
        let [first, later] = self.waves;
        let second_s = self.began_s + first.period_s;
        let rest = (0..).map(move |n| second_s + f64::from(n) * later.period_s);
        let rest = rest.map(move |start_s| (start_s, start_s + later.pulse_s));
        std::iter::once((self.began_s, self.began_s + first.pulse_s))
            .chain(rest)
            .take_while(move |(start_s, _)| *start_s < self.until_s)
            .map(move |(start_s, end_s)| (start_s.max(self.from_s), end_s.min(self.until_s)))
            .filter(|(start_s, end_s)| start_s < end_s)
    }
}

#[derive(Default)]
struct FakePwm {
    rules: PwmRules,
    now_s: f64,
    log: Vec<String>,
    runs: Vec<PulseRun>,
}

impl FakePwm {
    fn write(&mut self, file: &Path, text: &str) -> io::Result<()> {
        let name = file.file_name().and_then(|name| name.to_str()).expect("a name");
        let folder = file.parent().expect("a folder");
        let refusal = |kind: ErrorKind| Err(kind.into());
        if self.rules.read_only {
            return refusal(ErrorKind::ReadOnlyFilesystem);
        }
        if name == "export" {
            return self.export(&folder.join(format!("pwm{text}")));
        }
        if self.now_s < self.rules.opened_at_s {
            return refusal(ErrorKind::PermissionDenied);
        }
        let held = |name: &str| fs::read_to_string(folder.join(name)).expect("an attribute");
        let number = |text: &str| text.trim().parse::<u64>().expect("a number");
        let mut now = [number(&held("period")), number(&held("duty_cycle"))];
        match name {
            "period" => now[0] = number(text),
            "duty_cycle" => now[1] = number(text),
            _ => {}
        }
        let [period_ns, pulse_ns] = now;
        let fits = self.rules.period_max_ns.is_none_or(|most_ns| period_ns <= most_ns);
        let turned = self.rules.upright && text == "inversed";
        if period_ns == 0 || pulse_ns > period_ns || !fits || turned {
            return refusal(ErrorKind::InvalidInput);
        }
        assert!(name == "enable" || held("enable") == "0\n", "{name} of a running channel");
        if name == "enable" {
            let period_s = period_ns as f64 * 1e-9;
            self.enable(text == "1", Wave { period_s, pulse_s: pulse_ns as f64 * 1e-9 });
        }
        self.log.push(format!("{name} {text}"));
        fs::write(file, format!("{text}\n"))
    }

    fn export(&mut self, channel: &Path) -> io::Result<()> {
        if self.rules.taken || channel.exists() {
            return Err(ErrorKind::ResourceBusy.into());
        }
        self.log.push("export".to_owned());
        fs::create_dir(channel)?;
        for (name, text) in
            [("period", "0\n"), ("duty_cycle", "0\n"), ("polarity", "normal\n"), ("enable", "0\n")]
        {
            fs::write(channel.join(name), text)?;
        }
        Ok(())
    }

    fn enable(&mut self, on: bool, wave: Wave) {
        let from_s = self.now_s;
        let before = self.runs.last().map_or(wave, |run| run.waves[1]);
        let first = if self.rules.is_lazy { before } else { wave };
        let began_s = from_s - self.rules.starts_at * first.period_s;
        match self.runs.last_mut().filter(|run| run.until_s.is_infinite()) {
            Some(run) if !on => run.until_s = from_s,
            None if on => {
                let until_s = f64::INFINITY;
                self.runs.push(PulseRun { from_s, until_s, began_s, waves: [first, wave] });
            }
            _ => {}
        }
    }
}

/// A clock, and the kernel's folder with one chip.
#[derive(Clone)]
struct PwmBoard(Arc<Mutex<FakePwm>>, Arc<tempfile::TempDir>);

impl PwmBoard {
    fn new(rules: PwmRules) -> PwmBoard {
        let root = tempfile::tempdir().expect("a folder");
        let (device, chip) = (root.path().join(CHIP), root.path().join("class/pwmchip2"));
        fs::create_dir_all(&chip).expect("a folder");
        fs::create_dir(&device).expect("a folder");
        symlink(&device, chip.join("device")).expect("a link");
        fs::write(chip.join("npwm"), "4\n").expect("a file");
        PwmBoard(Arc::new(Mutex::new(FakePwm { rules, ..FakePwm::default() })), Arc::new(root))
    }

    fn kernel(&self) -> std::sync::MutexGuard<'_, FakePwm> {
        self.0.lock().expect("no test panicked meanwhile")
    }

    fn channel(&self, attribute: &str) -> PathBuf {
        self.1.path().join("class/pwmchip2/pwm2").join(attribute)
    }

    fn open(&self, chip: &str, channel: u32) -> Result<PwmTrigger, RigError> {
        let (writer, chip) = (self.clone(), chip.to_owned());
        let write = move |file: &Path, text: &str| writer.kernel().write(file, text);
        let name = PwmChannel { chip, channel, active: Level::Low };
        let (root, clock) = (self.1.path().join("class"), Box::new(self.clone()));
        PwmTrigger::open(&root, Box::new(write), clock, &name, PULSE_US)
    }

    fn trigger(&self) -> PwmTrigger {
        self.open(CHIP, 2).unwrap_or_else(|error| panic!("{error}"))
    }
}

impl Clock for PwmBoard {
    /// The current time; a reading takes two microseconds.
    fn now(&self) -> Moment {
        let mut kernel = self.kernel();
        kernel.now_s += 2e-6;
        Moment(kernel.now_s)
    }

    fn wait_until(&self, moment: Moment) {
        let mut kernel = self.kernel();
        kernel.now_s = kernel.now_s.max(moment.0);
    }
}

#[test]
fn every_accepted_pulse_is_whole_wherever_its_period_starts() {
    // Phases of a period of 90 ms; the second cuts a pulse by less than the tolerance.
    let places_ms = [0.0, 1.5, 25.0, 49.0, 50.0, 51.0, 70.0, 89.9];
    let cases = places_ms.into_iter().flat_map(|ms| [(ms / 90.0, false), (ms / 90.0, true)]);
    for (starts_at, is_lazy) in cases {
        let board = PwmBoard::new(PwmRules { starts_at, is_lazy, ..PwmRules::default() });
        let mut trigger = board.trigger();
        assert!(board.kernel().runs.is_empty(), "no pulse before the first exposure");
        for times in [1.0, 1.0, 3.0, 1.0] {
            trigger.expose_times(times);
            let fired_s = trigger.fire().unwrap_or_else(|error| panic!("{error}")).0;
            let wanted_s = f64::from(PULSE_US) * 1e-6 * times;
            board.wait_until(Moment(fired_s + 2.0 * wanted_s + 0.08));
            // The camera computes the start as the end minus the exposure.
            let runs = board.kernel().runs.clone();
            let ended_s = board.now().0;
            let accepted: Vec<f64> = runs
                .into_iter()
                .flat_map(|run| PulseRun { until_s: run.until_s.min(ended_s), ..run }.pulses())
                .filter(|(_, end_s)| *end_s < ended_s && end_s - wanted_s + GRACE_S >= fired_s)
                .map(|(start_s, end_s)| end_s - start_s)
                .collect();
            assert!(!accepted.is_empty(), "{starts_at}");
            assert!(
                accepted.iter().all(|s| (s - wanted_s).abs() < 1e-9),
                "{starts_at}: {accepted:?}"
            );
        }
    }
}

#[test]
fn a_new_channel_is_set_before_it_is_enabled_and_disabled_at_the_end() {
    let board = PwmBoard::new(PwmRules { opened_at_s: 0.3, ..PwmRules::default() });
    let mut trigger = board.trigger();
    let settings = ["export", "period 90000000", "polarity inversed", "duty_cycle 50000000"];
    assert_eq!(board.kernel().log, settings);
    trigger.fire().unwrap_or_else(|error| panic!("{error}"));
    trigger.fire().unwrap_or_else(|error| panic!("{error}"));
    drop(trigger);
    assert_eq!(board.kernel().log[4..], ["enable 1", "enable 0"]);
    assert!(board.channel("").exists(), "a released channel goes low");
}

#[test]
fn the_pulses_of_a_killed_program_end_at_the_next_opening() {
    // The killed program's periods were shorter or longer than the wanted one.
    for times in [0.1, 3.0] {
        let board = PwmBoard::new(PwmRules::default());
        let mut killed = std::mem::ManuallyDrop::new(board.trigger());
        killed.expose_times(times);
        killed.fire().unwrap_or_else(|error| panic!("{error}"));
        let _opened = board.trigger();
        let kernel = board.kernel();
        assert_eq!(kernel.runs.len(), 1);
        assert!(kernel.runs[0].until_s.is_finite(), "{times}");
        drop(kernel);
        let set = |name| fs::read_to_string(board.channel(name)).expect("an attribute");
        assert_eq!((set("enable"), set("duty_cycle")), ("0\n".into(), "50000000\n".into()));
    }
}

#[test]
fn errors_name_the_file_what_was_found_and_what_is_allowed() {
    let fine = PwmRules::default();
    for (rules, words) in [
        (PwmRules { taken: true, ..fine }, ["in use: the kernel refuses 2 for", "pwmchip2/export"]),
        (PwmRules { opened_at_s: 9.0, ..fine }, ["pwm2/period", "files of the group gpio"]),
        (PwmRules { read_only: true, ..fine }, ["pwmchip2/export", "ReadWritePaths="]),
        (PwmRules { upright: true, ..fine }, ["inversed for", "polarities of this chip"]),
        (PwmRules { period_max_ns: Some(1 << 24), ..fine }, ["90000000 for", "pwm2/period"]),
    ] {
        let error = PwmBoard::new(rules).open(CHIP, 2).err().expect("a broken rule").to_string();
        assert!(words.iter().all(|word| error.contains(word)), "{error}");
    }
    let board = PwmBoard::new(fine);
    let error = board.open("1f0009c000.pwm", 2).err().expect("another chip").to_string();
    assert!(error.contains("\"1f0009c000.pwm\", allowed 1f00098000.pwm"), "{error}");
    let error = board.open(CHIP, 4).err().expect("a fifth channel").to_string();
    assert!(error.contains("channel 4 of") && error.contains("allowed 0, 1, 2, 3"), "{error}");
    assert_eq!(chips(Path::new("/nowhere")), []);
}

#[test]
fn another_program_that_sets_the_channel_is_an_error() {
    for (attribute, text) in [("duty_cycle", "49000000"), ("enable", "0"), ("polarity", "normal")] {
        let board = PwmBoard::new(PwmRules::default());
        let mut trigger = board.trigger();
        assert!(trigger.fire().is_ok());
        fs::write(board.channel(attribute), text).expect("an attribute");
        let error = trigger.fire().expect_err("it is set").to_string();
        assert!(error.contains(&format!("pwm2/{attribute} to {text}; end it")), "{error}");
    }
}

#[test]
fn attributes_are_written_and_never_made() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("enable");
    let missing = write_attribute(&file, "1").expect_err("no such attribute");
    assert_eq!((missing.kind(), file.exists()), (ErrorKind::NotFound, false));
    fs::write(&file, "0\n").expect("a file");
    write_attribute(&file, "1").expect("an attribute");
    assert!(fs::read_to_string(&file).is_ok_and(|text| text.starts_with('1')));
}
