//! Twelve places at full size where colours fail first: clipped highlights, skin, leaves, fur,
//! small lights in the dark, stars in inks.

use relens::chart::test_rig::{PHOTO_SEED, TestPhoto, TestRig};
use relens::config::RigFile;
use relens::frame::{Channels, Size};
use relens::measurement::{calibrate, to_the_end};
use relens::picture::Tone;
use relens::pipeline::method;
use relens::rig::simulated::open;

use crate::appearance::Appearance;
use crate::made::Made;
use crate::{Failure, colour, seconds};

/// A scene, and the centre of the place as shares of width and height.
type Place = (&'static str, [f64; 2]);

const PLACES: [Place; 12] = [
    ("astronaut", [0.71, 0.91]),
    ("coffee", [0.61, 0.70]),
    ("rocket", [0.30, 0.93]),
    ("rocket", [0.60, 0.93]),
    ("astronaut", [0.43, 0.13]),
    ("admiral", [0.46, 0.46]),
    ("cat", [0.37, 0.38]),
    ("raccoon", [0.24, 0.70]),
    ("raccoon", [0.60, 0.42]),
    ("galaxies", [0.36, 0.46]),
    ("chart, black and white", [0.5, 0.5]),
    ("chart, green without contrast", [0.5, 0.5]),
];
/// Side of a crop, pixels.
const SIDE: usize = 128;
const GAP: usize = 4;
const COLUMNS: usize = 6;
/// Number of crops of each place: scene, photo and result.
const SHOWN: usize = 3;

/// A white sheet of crops.
struct Sheet {
    size: Size,
    codes: Vec<u8>,
}

impl Sheet {
    fn new(size: Size) -> Sheet {
        Sheet { size, codes: vec![u8::MAX; 3 * size.width * size.height] }
    }

    /// Copies the part of `picture` about (`x`, `y`) into crop `row` of the `n`-th place.
    fn put(&mut self, picture: &Appearance, [x, y]: [f64; 2], n: usize, row: usize) {
        let from = picture.size();
        let corner = |share: f64, side: usize| {
            ((share * side as f64) as usize).saturating_sub(SIDE / 2).min(side - SIDE)
        };
        let (left, top) = (corner(x, from.width), corner(y, from.height));
        let band = SHOWN * SIDE + GAP;
        let at_x = n % COLUMNS * (SIDE + GAP);
        let at_y = n / COLUMNS * band + row * SIDE;
        let bytes = picture.bytes();
        for line in 0..SIDE {
            let source = 3 * ((top + line) * from.width + left);
            let target = 3 * ((at_y + line) * self.size.width + at_x);
            self.codes[target..][..3 * SIDE].copy_from_slice(&bytes[source..][..3 * SIDE]);
        }
    }
}

/// Sheet of crops on the simulated rig of `rig`.
pub(crate) fn run(rig: &RigFile) -> Result<Made, Failure> {
    let size = rig.photo.size();
    if size.width < SIDE || size.height < SIDE {
        return Err(format!("found photos of {size}, allowed {SIDE}×{SIDE} or larger").into());
    }
    let (mut devices, witness) = open(rig)?;
    let calibration = calibrate(&mut devices, rig, None, &mut to_the_end)?;
    let mut test_rig = TestRig::on(rig.clone(), devices, &calibration, seconds)?;
    let tone = Tone::of_curve(rig.photo.curve, 8);
    let bands = PLACES.len().div_ceil(COLUMNS);
    let mut sheet =
        Sheet::new(Size::new(COLUMNS * (SIDE + GAP) - GAP, bands * (SHOWN * SIDE + GAP) - GAP));
    for (seed, (name, light)) in colour::with_kept(size, &tone)?.into_iter().enumerate() {
        let mut places = PLACES.iter().enumerate().filter(|(_, place)| place.0 == name).peekable();
        if places.peek().is_none() {
            continue;
        }
        let photo = TestPhoto::taken(&witness, rig.photo.curve, &light, PHOTO_SEED + seed as u64);
        let solver = method(rig, rig.restore.method);
        let (solved, _) = test_rig.solve(&photo, Channels::Colour, &*solver, &mut |_, _| {})?;
        let scene = Appearance::new(&tone, &witness.shaded(&light));
        let shown =
            [scene, Appearance::new(&tone, &photo.light), Appearance::new(&tone, &solved.picture)];
        for (n, &(_, place)) in places {
            for (row, picture) in shown.iter().enumerate() {
                sheet.put(picture, place, n, row);
            }
        }
        log::info!("{name}");
    }
    let name = format!("{}-crops.png", rig.name);
    Ok(Made { files: vec![(name, colour::png(sheet.size, &sheet.codes)?)], ..Made::default() })
}
