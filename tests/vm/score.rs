//! Quality of a restored photo: `score SHARP PHOTO RESTORED [GAIN]` prints the gain in SSIM
//! (luminance of the display values) and fails if it differs from GAIN by more than 0.01; `score
//! --crop IN WIDTH HEIGHT OUT` crops a scene.
// A test program, which panics on errors.
#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs)]

use relens::deconvolution::quality::ssim;
use relens::frame::{Plane, Size};

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// Rec. 709 luma of the file's codes.
fn luma(path: &str) -> Outcome<Plane> {
    let picture = image::open(path)?.to_rgb8();
    let size = Size::new(picture.width() as usize, picture.height() as usize);
    let value = |p: &image::Rgb<u8>| {
        0.2126 * f32::from(p[0]) + 0.7152 * f32::from(p[1]) + 0.0722 * f32::from(p[2])
    };
    Ok(Plane::from_fn(size, |x, y| value(picture.get_pixel(x as u32, y as u32))))
}

fn main() -> Outcome<()> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    match words.as_slice() {
        ["--crop", from, width, height, to] => {
            let (width, height): (u32, u32) = (width.parse()?, height.parse()?);
            let picture = image::open(from)?.resize_to_fill(
                width,
                height,
                image::imageops::FilterType::Triangle,
            );
            picture.to_rgb8().save(to)?;
            Ok(())
        }
        [sharp, photo, restored, wanted @ ..] => {
            let sharp = luma(sharp)?;
            let (before, after) = (ssim(&sharp, &luma(photo)?), ssim(&sharp, &luma(restored)?));
            let gain = after - before;
            println!("{gain:.4}");
            if let [wanted] = wanted {
                let wanted: f64 = wanted.trim().parse()?;
                println!("SSIM {before:.4} -> {after:.4}; the in-process rig gained {wanted:.4}");
                if (gain - wanted).abs() > 0.01 {
                    return Err("not within 0.01 of the in-process rig".into());
                }
            }
            Ok(())
        }
        _ => {
            Err("usage: score SHARP PHOTO RESTORED [GAIN] | score --crop IN WIDTH HEIGHT OUT"
                .into())
        }
    }
}
