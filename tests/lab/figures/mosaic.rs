//! Pictures side by side.

use relens::deconvolution::lens_model::LensModel;
use relens::frame::Channel;
use relens::frame::resample::resize;
use relens::frame::{Plane, Rect, Size};

/// Width of the white gap between two tiles, pixels.
const GAP_PX: usize = 6;

/// Tiles of one size in rows of `columns`, white between them.
pub(super) fn mosaic(tiles: &[Plane], columns: usize) -> Plane {
    let Some(tile) = tiles.first().map(Plane::size) else { return Plane::zeros(Size::new(0, 0)) };
    let columns = columns.clamp(1, tiles.len());
    let rows = tiles.len().div_ceil(columns);
    let along = |n: usize, length: usize| n * (length + GAP_PX) - GAP_PX;
    let mut whole =
        Plane::filled(Size::new(along(columns, tile.width), along(rows, tile.height)), 255.0);
    for (n, picture) in tiles.iter().enumerate() {
        let (x, y) =
            ((n % columns) * (tile.width + GAP_PX), (n / columns) * (tile.height + GAP_PX));
        for row in 0..tile.height.min(picture.height()) {
            let width = tile.width.min(picture.width());
            whole.row_mut(y + row)[x..x + width].copy_from_slice(&picture.row(row)[..width]);
        }
    }
    whole
}

/// Part of `plane` about (`across`, `down`), enlarged `times` by repeating pixels. The place and
/// the extent `part` are shares of the sides of `plane`.
pub(super) fn detail(plane: &Plane, (across, down): (f64, f64), part: f64, times: usize) -> Plane {
    let size = plane.size();
    let cut = |length: usize| ((length as f64 * part) as usize).clamp(1, length);
    let cut = Size::new(cut(size.width), cut(size.height));
    let start = |at: f64, length: usize, cut: usize| {
        ((at * length as f64) as usize).saturating_sub(cut / 2).min(length - cut)
    };
    let (x, y) = (start(across, size.width, cut.width), start(down, size.height, cut.height));
    enlarged(&plane.crop(Rect { x, y, size: cut }), times)
}

/// `plane` with every pixel repeated `times` in both directions.
pub(super) fn enlarged(plane: &Plane, times: usize) -> Plane {
    let size = Size::new(plane.width() * times, plane.height() * times);
    Plane::from_fn(size, |x, y| plane.at(x / times, y / times))
}

/// `plane` at half its size.
pub(super) fn halved(plane: &Plane) -> Plane {
    resize(plane, Size::new(plane.width() / 2, plane.height() / 2))
}

/// Some green functions of `lens` over its field, each scaled to its maximum; their square roots,
/// to show faint skirts.
pub(super) fn functions_map(lens: &LensModel, columns: usize, rows: usize) -> Plane {
    let functions = lens.functions();
    let side = Size::new(functions.support_px, functions.support_px);
    let mut tiles = Vec::new();
    for row in 0..rows {
        for column in 0..columns {
            let pick = |n: usize, of: usize, have: usize| (2 * n + 1) * have / (2 * of);
            let (row, column) =
                (pick(row, rows, functions.rows), pick(column, columns, functions.columns));
            let taps = functions.function(Channel::Green, row, column);
            let most = taps.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
            let values = taps.iter().map(|t| 255.0 * (t.max(0.0) / most).sqrt()).collect();
            tiles.push(Plane::from_vec(side, values).unwrap_or_else(|| Plane::zeros(side)));
        }
    }
    mosaic(&tiles, columns)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_lie_side_by_side_with_white_between() {
        let tile = |v: f32| Plane::filled(Size::new(4, 3), v);
        let whole = mosaic(&[tile(1.0), tile(2.0), tile(3.0)], 2);
        assert_eq!(whole.size(), Size::new(8 + GAP_PX, 6 + GAP_PX));
        assert_eq!(
            (whole.at(0, 0), whole.at(4 + GAP_PX, 2), whole.at(3, 3 + GAP_PX)),
            (1.0, 2.0, 3.0)
        );
        assert_eq!((whole.at(5, 0), whole.at(4 + GAP_PX, 3 + GAP_PX)), (255.0, 255.0));
    }

    #[test]
    fn a_detail_stays_inside_and_is_enlarged() {
        let plane = Plane::from_fn(Size::new(40, 20), |x, y| (100 * y + x) as f32);
        let corner = detail(&plane, (1.0, 0.0), 0.25, 2);
        assert_eq!(corner.size(), Size::new(20, 10));
        assert_eq!((corner.at(0, 0), corner.at(1, 1), corner.at(19, 9)), (30.0, 30.0, 439.0));
    }
}
