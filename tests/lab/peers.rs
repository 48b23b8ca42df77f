//! Peers from outside: what other people's programs make of the very same photos.
//!
//! [`captures`] gives them the photos, the scenes and the lens's central function as measured;
//! `tests/benches/outside.py` restores with scikit-image and prints rows; [`trade`] takes the rows
//! into the chart of speed against accuracy, if they are of these photos.

use relens::chart;
use relens::chart::contestants::OUTSIDE;
use relens::chart::scenes::Scene;
use relens::chart::test_rig::TestRig;
use relens::chart::trade::Point;
use relens::config::RigFile;
use relens::frame::{Channel, Plane, npy_f32};

use crate::made::Made;
use crate::{Failure, seconds, told};

/// Columns of the rows read.
const HEAD: [&str; 6] = ["setting", "scene", "photo-crc32", "seconds", "ssim", "psnr-db"];

/// Why rows of peers cannot be taken.
#[derive(Debug, thiserror::Error)]
enum PeerError {
    /// The first line is another.
    #[error("the peers' rows begin with `{found}`; `{}` is allowed", HEAD.join(","))]
    Head {
        /// What it says.
        found: String,
    },
    /// A line does not hold what it should.
    #[error(
        "line {line} of the peers' rows is `{found}`; a setting, a scene, a checksum and three \
         numbers are allowed"
    )]
    Line {
        /// Its number, from 1.
        line: usize,
        /// What it says.
        found: String,
    },
    /// The rows are of other photos.
    #[error(
        "the peers' `{setting}` restored another photo of {scene}; the photos of this chart are \
         allowed"
    )]
    Photo {
        /// The setting.
        setting: String,
        /// The scene.
        scene: &'static str,
    },
}

/// Files for peers: `SCENE-truth.npy` and `SCENE-photo.npy` (`f32`, light 0..255, rows × columns),
/// and `function.npy`, the central function as measured, summing to about 1; all of the green
/// channel.
pub(crate) fn captures(rig: &RigFile) -> Result<Made, Failure> {
    let mut test_rig = TestRig::open(rig.clone(), seconds)?;
    let array = |plane: &Plane| npy_f32(&[plane.height(), plane.width()], plane.data());
    let mut files = Vec::new();
    for scene in Scene::STUDY_PHOTOGRAPHS {
        let (truth, photo) = (test_rig.truth(scene), test_rig.photograph(scene, 0)?.light);
        for (what, light) in [("truth", truth), ("photo", photo)] {
            let name = format!("{}-{what}.npy", scene.name());
            files.push((name, array(light.plane(Channel::Green))));
        }
    }
    let functions = test_rig.parts().0.model().functions();
    let k = functions.support_px;
    let central = functions.function(Channel::Green, functions.rows / 2, functions.columns / 2);
    files.push(("function.npy".to_owned(), npy_f32(&[k, k], central)));
    Ok(Made { files, ..Made::default() })
}

/// Speed against accuracy with the peers' `rows` in it.
pub(crate) fn trade(rig: &RigFile, quick: bool, rows: &str) -> Result<Made, Failure> {
    let mut test_rig = TestRig::open(rig.clone(), seconds)?;
    let mut photos = Vec::new();
    for scene in Scene::STUDY_PHOTOGRAPHS {
        photos.push((scene, test_rig.photograph(scene, 0)?.light.plane(Channel::Green).clone()));
    }
    let outside = read(rows, &photos)?;
    let mut trade = chart::trade(rig, quick, seconds, &mut told)?;
    trade.points.extend(outside);
    let remark = " The peers' seconds are from a run of their own on the same machine.";
    let command = format!("`cargo run --release --example lab -- peers --rig {}.toml`", rig.name);
    let chart::Chart { tables, drawings } = chart::chart(rig, &trade, remark, &command);
    Ok(Made { tables, drawings, ..Made::default() })
}

/// The CRC-32 of a photo's green plane, `f32` in little-endian order.
fn checksum(photo: &Plane) -> u32 {
    let bytes: Vec<u8> = photo.data().iter().flat_map(|v| v.to_le_bytes()).collect();
    crc32fast::hash(&bytes)
}

/// One line.
struct Row<'a> {
    setting: &'a str,
    scene: Scene,
    checksum: u32,
    numbers: [f64; 3],
}

fn row(line: &str) -> Option<Row<'_>> {
    let cells: Vec<&str> = line.split(',').map(str::trim).collect();
    let &[setting, scene, checksum, seconds, ssim, psnr_db] = cells.as_slice() else { return None };
    let number = |cell: &str| cell.parse::<f64>().ok().filter(|v| v.is_finite());
    Some(Row {
        setting,
        scene: Scene::ALL.into_iter().find(|s| s.name() == scene)?,
        checksum: u32::from_str_radix(checksum, 16).ok()?,
        numbers: [number(seconds)?, number(ssim)?, number(psnr_db)?],
    })
}

/// The peers' rows in `text` as points, means over the scenes; `photos` are the photos of this
/// chart.
fn read(text: &str, photos: &[(Scene, Plane)]) -> Result<Vec<Point>, PeerError> {
    let mut lines = text.lines().enumerate();
    let head = lines.next().map_or("", |(_, line)| line.trim());
    if head != HEAD.join(",") {
        return Err(PeerError::Head { found: head.to_owned() });
    }
    let mut settings: Vec<(&str, Vec<[f64; 3]>)> = Vec::new();
    for (n, line) in lines.filter(|(_, line)| !line.trim().is_empty()) {
        let Some(row) = row(line) else {
            return Err(PeerError::Line { line: n + 1, found: line.to_owned() });
        };
        let same = photos
            .iter()
            .any(|(scene, photo)| *scene == row.scene && checksum(photo) == row.checksum);
        if !same {
            return Err(PeerError::Photo {
                setting: row.setting.to_owned(),
                scene: row.scene.name(),
            });
        }
        match settings.iter_mut().find(|(setting, _)| *setting == row.setting) {
            Some((_, rows)) => rows.push(row.numbers),
            None => settings.push((row.setting, vec![row.numbers])),
        }
    }
    Ok(settings.into_iter().map(|(setting, rows)| point(setting, &rows)).collect())
}

fn point(setting: &str, rows: &[[f64; 3]]) -> Point {
    let mean = |n: usize| rows.iter().map(|r| r[n]).sum::<f64>() / rows.len() as f64;
    Point {
        family: OUTSIDE,
        line: String::new(),
        setting: setting.to_owned(),
        printed: false,
        captures: 0.0,
        capture_seconds: 0.0,
        computing_seconds: mean(0),
        ssim: mean(1),
        psnr_db: mean(2),
        edge_difference: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use relens::frame::Size;

    #[test]
    fn rows_of_these_photos_become_means_and_others_are_refused() {
        let photo = Plane::from_fn(Size::new(3, 2), |x, y| (x + 10 * y) as f32);
        let other = photo.map(|v: f32| v + 1.0);
        let photos = [(Scene::Astronaut, photo.clone()), (Scene::Coffee, other.clone())];
        let head = HEAD.join(",");
        let line = |scene: &str, photo: &Plane, s: f64| {
            format!("x,{scene},{:08x},{s},0.5,30", checksum(photo))
        };
        let text = format!(
            "{head}\n{}\n{}\n",
            line("astronaut", &photo, 1.0),
            line("coffee", &other, 2.0)
        );
        let points = read(&text, &photos).unwrap();
        assert_eq!((points.len(), points[0].computing_seconds, points[0].ssim), (1, 1.5, 0.5));
        let wrong = format!("{head}\n{}\n", line("coffee", &photo, 1.0));
        assert!(matches!(read(&wrong, &photos), Err(PeerError::Photo { scene: "coffee", .. })));
        assert!(matches!(
            read(&format!("{head}\nx,coffee,zz,1,1,1\n"), &photos),
            Err(PeerError::Line { line: 2, .. })
        ));
        assert!(matches!(read("a,b\n", &photos), Err(PeerError::Head { .. })));
    }
}
