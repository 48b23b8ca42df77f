//! What `relens help` says.

/// The overview, or the page of one command.
pub(super) fn text(about: Option<&str>) -> &'static str {
    match about {
        None => OVERVIEW,
        Some("demo") => DEMO,
        Some("run") => RUN,
        Some("calibrate") => CALIBRATE,
        Some("restore") => RESTORE,
        Some("photograph") => PHOTOGRAPH,
        Some("chart") => CHART,
        Some("check") => CHECK,
        Some("status") => STATUS,
        Some("screens") => SCREENS,
        Some("press") => PRESS,
        Some(_) => OVERVIEW,
    }
}

const OVERVIEW: &str = "\
relens makes cheap lenses take good photographs: it shows candidate pictures on a panel,
photographs them through the lens the photo was taken with, and adjusts the candidate until
its photograph is the photo.

  relens demo                             the whole story on a simulated rig; start here
  relens run --rig RIG.toml               watch the drop folder and restore what is dropped
  relens calibrate --rig RIG.toml         measure the rig and keep what was measured
  relens restore --rig RIG.toml IN -o OUT one photo
  relens photograph --rig RIG.toml SHARP -o PHOTO
                                          the photo a simulated rig's camera would take
  relens chart --rig RIG.toml -o DIR      speed against accuracy
  relens check --rig RIG.toml             devices, calibration, noise: what is wrong, what to do
  relens status                           what the daemon is doing
  relens screens --rig RIG.toml -o DIR    what the panel shows between jobs, as pictures
  relens press                            presses the button of a simulated rig
  relens help [COMMAND]                   more about a command
  relens version

Rig files: simulated.toml, study.toml, paper-synthetic.toml and small.toml are part of the program.
Exit codes: 0 done; 1 some photos failed, listed; 2 wrong use or rig file; 3 call the operator.
--verbose (-v) with any command shows debug messages.";

const DEMO: &str = "\
relens demo [--out DIR]

Takes photos of four scenes through the simulated rig's bad lens, drops them into an inbox, restores
them, and prints how much nearer to the scenes they came. DIR (relens-demo when not given, with a
number if that is taken) then holds the folders; open DIR/outbox/index.html to see before and after.";

const RUN: &str = "\
relens run --rig RIG.toml [--folder DIR] [--once] [--box NAME]

Works on the folders inbox, working, outbox, done and failed in DIR (this folder when not given), which
are made if need be. Photos put into the inbox are restored into the outbox, with a report beside each
and a page, outbox/index.html, that shows all before and after. The originals go to done, or to failed
with a note that says why. Nothing is ever overwritten or lost, whenever the power fails.

  --once   empty the inbox and end
  --box    work as one box of several with the same lens that share DIR, which may be a network folder: a
           photo is restored by one of them, and taken over when that one dies. A box's own things are in
           DIR/box-NAME; give that folder to `calibrate`, `check` and `status`

A photo is taken when it is all there; one whose end is missing waits in the inbox. JPEG, PNG and TIFF
are read, 8 or 16 bits, of the rig's shape; other sizes of it are resampled. A simulated rig without a
calibration calibrates itself first.";

const CALIBRATE: &str = "\
relens calibrate --rig RIG.toml [--folder DIR]

Shows patterns, sees them, fits what the rig is, judges whether that is good, and keeps it in
DIR/calibration. A calibration that is no good is not kept; the old one stays.

With operating-point = \"fast\", \"balanced\" or \"best\" in [restore] of the rig file it then shows known scenes, restores
them with several settings, and keeps the chosen one in DIR/calibration/operating-point.toml: the best; or, of
those that take no longer than the rig file's own and have no less PSNR (fast: 1 dB less), the fastest within 0.002 SSIM
(fast: 0.01) of their best. Photos are restored with that from then on.";

const RESTORE: &str = "\
relens restore --rig RIG.toml PHOTO -o RESULT [--method NAME] [--report REPORT.json] [--folder DIR]

Restores one photo. RESULT may have another format than PHOTO; its ending tells. It must not exist yet.

  --method   paper, residual, unmatched, hybrid, block-matching, digital, wiener or richardson-lucy;
             the rig file's when not given
  --folder   where the folder `calibration` is; this folder when not given";

const PHOTOGRAPH: &str = "\
relens photograph --rig RIG.toml SHARP -o PHOTO

The photo that this rig's camera would take of the picture SHARP. Simulated rigs only. SHARP is cut to
the rig's shape. PHOTO must not exist yet; its ending tells the format.";

const CHART: &str = "\
relens chart --rig RIG.toml --out DIR [--quick] [--folder DIR]

Restores known scenes with every method and several settings of each, and draws speed against accuracy:
DIR gets the drawing (SVG), the table (Markdown) and its numbers (CSV). On a rig of devices the scenes are
shown on its panel; its calibration is looked for in --folder. --quick leaves out most settings of the methods
that lose.";

const CHECK: &str = "\
relens check --rig RIG.toml [--folder DIR]

Looks at every device, the calibration, drift, latency and noise, and says what is wrong and what to do. On a calibrated
rig it also tries whether the light's backward convolution is the adjoint of its forward one (the dot test).";

const STATUS: &str = "\
relens status [--folder DIR]

What the daemon on DIR (this folder when not given) is doing, from its state file.";

const SCREENS: &str = "\
relens screens --rig RIG.toml --out DIR

Draws one screen of each kind for the rig's panel, as PNG files in DIR: what the panel shows between jobs.";

const PRESS: &str = "\
relens press [--folder DIR] [--long]

Presses the button of the simulated rig that a `relens run` works with on DIR (this folder when not given).

  --long   holds it down: gives the job under way up; in maintenance, measures the lens anew";
