//! Settings on the chart of speed against accuracy: relens's own methods, the paper's loop, and
//! common methods with the measured lens.

use crate::config::{MethodName, RigFile};
use crate::deconvolution::method::Method;
use crate::deconvolution::method::paper::Paper;
use crate::deconvolution::method::richardson_lucy::RichardsonLucy;
use crate::deconvolution::method::total_variation::TotalVariation;
use crate::deconvolution::method::wiener::Wiener;
use crate::pipeline::{Setting, counted, paper};

/// A method with one setting.
pub struct Contestant {
    /// Family of methods; each has a mark and a colour on the chart.
    pub family: String,
    /// Line of the chart within the family; its settings differ in one number.
    pub line: String,
    /// Value of the number that differs along the line.
    pub setting: String,
    /// Whether this is the rig file's setting.
    pub is_filed: bool,
    /// The method.
    pub method: Box<dyn Method + Send + Sync>,
}

impl Contestant {
    /// `method` with a `setting` on a `line` of its `family`; line and setting may be empty.
    pub fn new(
        family: &str,
        line: &str,
        setting: &str,
        method: impl Method + Send + Sync + 'static,
    ) -> Self {
        let method = Box::new(method);
        let [family, line, setting] = [family, line, setting].map(str::to_owned);
        Contestant { family, line, setting, is_filed: false, method }
    }

    /// The contestant for `setting`; settings with the same number of captures form a line.
    pub fn of_setting(rig: &RigFile, setting: &Setting) -> Self {
        let Setting { steps, correction_steps, captures_max, rounds, .. } = *setting;
        let captures = match captures_max {
            0 => "no capture".to_owned(),
            count => counted(count as usize, "capture"),
        };
        let (line, value) = match setting.method {
            MethodName::Digital => (String::new(), counted(steps as usize, "step")),
            MethodName::Hybrid => (captures, format!("{steps}+{correction_steps} steps")),
            MethodName::BlockMatching => (captures, counted(rounds as usize, "round")),
            _ => Default::default(),
        };
        Contestant {
            family: setting.method.name().to_owned(),
            line,
            setting: value,
            is_filed: *setting == Setting::as_filed(rig, rig.restore.method),
            method: setting.method(rig),
        }
    }

    /// Name in tables and logs.
    pub fn name(&self) -> String {
        name(&[&self.family, &self.line, &self.setting])
    }
}

/// Joins the words that are not empty by commas.
pub(super) fn name(words: &[&str]) -> String {
    let words: Vec<&str> = words.iter().copied().filter(|word| !word.is_empty()).collect();
    words.join(", ")
}

/// All contestants for `rig`, the rig file's own setting first.
pub fn contestants(rig: &RigFile) -> Vec<Contestant> {
    let filed = Setting::as_filed(rig, rig.restore.method);
    let mut settings = vec![filed];
    settings.extend(settings_tried(&filed));
    let of_setting = |setting: &Setting| Contestant::of_setting(rig, setting);
    let mut all: Vec<Contestant> = distinct(settings).iter().map(of_setting).collect();
    let printed = paper(rig);
    for iterations in [3, printed.iterations] {
        let setting = counted(iterations as usize, "iteration");
        all.push(Contestant::new("paper", "", &setting, Paper { iterations, ..printed }));
    }
    all.extend(usual());
    all
}

/// The `settings` without repetitions, in order.
pub(super) fn distinct(settings: Vec<Setting>) -> Vec<Setting> {
    let is_first = |n: &usize| !settings[..*n].contains(&settings[*n]);
    (0..settings.len()).filter(is_first).map(|n| settings[n]).collect()
}

fn settings_tried(filed: &Setting) -> Vec<Setting> {
    let of = |method| Setting { method, ..*filed };
    let mut all = Vec::new();
    all.extend([4, 16, 64].map(|steps| Setting { steps, ..of(MethodName::Digital) }));
    all.extend([(8, 2), (16, 4), (32, 8)].map(|(steps, correction_steps)| Setting {
        steps,
        correction_steps,
        captures_max: 1,
        ..of(MethodName::Hybrid)
    }));
    for (captures_max, rounds) in [(0, 1), (0, 8), (1, 1), (1, 2), (1, 8)] {
        all.push(Setting { captures_max, rounds, ..of(MethodName::BlockMatching) });
    }
    all
}

/// Common methods, which use the measured lens and no capture.
fn usual() -> Vec<Contestant> {
    let mut all = Vec::new();
    for noise_to_signal in [0.003, 0.01, 0.03] {
        let setting = format!("noise/signal {noise_to_signal}");
        all.push(Contestant::new("wiener", "", &setting, Wiener { noise_to_signal }));
    }
    for steps in [10, 20, 40] {
        let setting = format!("{steps} steps");
        all.push(Contestant::new("richardson-lucy", "", &setting, RichardsonLucy { steps }));
    }
    for strength in [0.15, 0.3, 0.6] {
        let setting = format!("strength {strength}");
        let method = TotalVariation { steps: 40, strength };
        all.push(Contestant::new("total-variation", "", &setting, method));
    }
    all
}
