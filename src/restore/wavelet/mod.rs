//! Symlets 8: orthonormal analysis and synthesis, periodised (paper Eq. 3).
//!
//! One step turns a line x of even length N into N/2 averages a and N/2 details d,
//! a\[o\] = Σⱼ lo\[j\] x\[(2o + 8 − j) mod N\] and the same with hi, which is an orthonormal change of basis for
//! every even N; synthesis is its transpose. A line of odd length first has its last pixel repeated once, and
//! synthesis drops it again (PyWavelets' "periodization" does the same): reconstruction stays perfect, the
//! repeated pixel alone keeps that border from being orthonormal. A plane whose sides are multiples of
//! 2^levels never meets this.

mod two_sums;

use crate::frame::{Plane, Size};
use two_sums::two_sums;

/// Low-pass analysis filter of Symlets 8, to double precision, as tabulated by PyWavelets.
const LOW: [f64; 16] = [
    -0.003_382_415_951_006_125_6,
    -0.000_542_132_331_791_148_1,
    0.031_695_087_811_492_98,
    0.007_607_487_324_917_605,
    -0.143_294_238_350_809_7,
    -0.061_273_359_067_658_524,
    0.481_359_651_258_372_2,
    0.777_185_751_700_523_5,
    0.364_441_894_835_331_4,
    -0.051_945_838_107_709_04,
    -0.027_219_029_917_056_003,
    0.049_137_179_673_607_506,
    0.003_808_752_013_890_615,
    -0.014_952_258_337_048_23,
    -0.000_302_920_514_721_366_8,
    0.001_889_950_332_759_459_4,
];

/// High-pass analysis filter: the low-pass one reversed with alternating signs.
fn high() -> [f64; 16] {
    std::array::from_fn(|j| if j % 2 == 0 { -LOW[15 - j] } else { LOW[15 - j] })
}

/// The three detail bands of one level, each half the size of the plane they describe.
#[derive(Debug, Clone, PartialEq)]
pub struct Details {
    /// Changes from row to row (horizontal edges).
    pub horizontal: Plane,
    /// Changes from column to column (vertical edges).
    pub vertical: Plane,
    /// Changes in both directions.
    pub diagonal: Plane,
}

/// A plane as seen by the wavelet.
#[derive(Debug, Clone, PartialEq)]
pub struct Coefficients {
    /// What is left after the last level.
    pub approximation: Plane,
    /// The details, finest level first.
    pub details: Vec<Details>,
}

impl Coefficients {
    /// Multiplies level by level: the details by `factors`, finest first, the approximation by the last of them.
    ///
    /// # Panics
    /// When there is not one factor for each level and one for the approximation, which is a bug of the caller.
    pub fn scale_levels(&mut self, factors: &[f32]) {
        assert!(factors.len() == self.details.len() + 1, "a factor for each level and the approximation");
        for (details, &factor) in self.details.iter_mut().zip(factors) {
            for band in details.bands_mut() {
                band.data_mut().iter_mut().for_each(|value| *value *= factor);
            }
        }
        let last = factors[self.details.len()];
        self.approximation.data_mut().iter_mut().for_each(|value| *value *= last);
    }
}

impl Details {
    /// The three bands.
    pub fn bands_mut(&mut self) -> [&mut Plane; 3] {
        [&mut self.horizontal, &mut self.vertical, &mut self.diagonal]
    }
}

/// The transform of planes of one size.
#[derive(Debug, Clone)]
pub struct Sym8 {
    /// Sizes of the approximations, the plane's own first.
    sizes: Vec<Size>,
    analysis: [[f32; 16]; 2],
    synthesis: [[f32; 16]; 2],
}

/// Memory a transform works in; any may be used with any transform, and grows to what is needed.
#[derive(Debug, Clone, Default)]
pub struct Scratch {
    low: Vec<f32>,
    high: Vec<f32>,
    line: Vec<f32>,
    turned: Vec<f32>,
    approximation: Vec<f32>,
}

/// Columns filtered at a time on the way down, so that the sixteen rows stay in the nearest cache
/// (16 · 256 · 4 bytes = 16 KiB).
const COLUMNS_AT_A_TIME: usize = 256;

impl Sym8 {
    /// The transform of planes of size `size` in `levels` levels (4 is the house's choice).
    pub fn new(size: Size, levels: usize) -> Self {
        let mut sizes = vec![size];
        for level in 0..levels {
            sizes.push(Size::new(sizes[level].width.div_ceil(2), sizes[level].height.div_ceil(2)));
        }
        let high = high();
        // Analysis reads rows 2o+8−j, j = 0..16, that is taps as they are; synthesis of pixels 2k−1 and 2k reads
        // averages and details k−4..k+4, with the odd taps for the first and the even ones for the second.
        let analysis = [LOW.map(|v| v as f32), high.map(|v| v as f32)];
        let taken = |odd: usize| {
            std::array::from_fn(|j| (if j < 8 { LOW[2 * j + odd] } else { high[2 * (j - 8) + odd] }) as f32)
        };
        Sym8 { sizes, analysis, synthesis: [taken(1), taken(0)] }
    }

    /// Size of the planes it transforms.
    pub fn size(&self) -> Size {
        self.sizes[0]
    }

    /// Number of levels.
    pub fn levels(&self) -> usize {
        self.sizes.len() - 1
    }

    /// Whether `coefficients` have the sizes of this transform.
    pub(super) fn owns(&self, coefficients: &Coefficients) -> bool {
        coefficients.approximation.size() == self.sizes[self.levels()]
            && coefficients.details.len() == self.levels()
            && coefficients.details.iter().zip(&self.sizes[1..]).all(|(d, &size)| d.diagonal.size() == size)
    }

    /// Coefficients of the right sizes, all zero.
    pub fn zeros(&self) -> Coefficients {
        let details = self.sizes[1..]
            .iter()
            .map(|&size| Details {
                horizontal: Plane::zeros(size),
                vertical: Plane::zeros(size),
                diagonal: Plane::zeros(size),
            })
            .collect();
        Coefficients { approximation: Plane::zeros(self.sizes[self.levels()]), details }
    }

    /// The coefficients of `plane`.
    ///
    /// # Panics
    /// When `plane` or `out` is of another size than the transform, which is a bug of the caller.
    pub fn analyse(&self, plane: &Plane, out: &mut Coefficients, scratch: &mut Scratch) {
        self.analyse_shifted(plane, (0, 0), out, scratch);
    }

    /// The coefficients of `plane` turned cyclically so that its pixel `shift` (column, row) comes first.
    pub fn analyse_shifted(
        &self,
        plane: &Plane,
        shift: (usize, usize),
        out: &mut Coefficients,
        scratch: &mut Scratch,
    ) {
        assert!(plane.size() == self.size(), "the plane has the transform's size");
        let mut approximation = std::mem::take(&mut scratch.approximation);
        for level in 0..self.levels() {
            let (from, to) = (self.sizes[level], self.sizes[level + 1]);
            let (input, shift) =
                if level == 0 { (plane.data(), shift) } else { (&approximation[..], (0, 0)) };
            self.rows_apart(input, from, shift, scratch);
            let Details { horizontal, vertical, diagonal } = &mut out.details[level];
            approximation.resize(to.area(), 0.0);
            self.columns_apart(
                &scratch.low,
                from.height,
                to,
                shift.1,
                &mut approximation,
                horizontal.data_mut(),
            );
            self.columns_apart(
                &scratch.high,
                from.height,
                to,
                shift.1,
                vertical.data_mut(),
                diagonal.data_mut(),
            );
        }
        if self.levels() == 0 {
            let turned = Plane::from_fn(plane.size(), |x, y| {
                plane.at((x + shift.0) % plane.width(), (y + shift.1) % plane.height())
            });
            out.approximation = turned;
        } else {
            out.approximation.data_mut().copy_from_slice(&approximation);
        }
        scratch.approximation = approximation;
    }

    /// The plane that has the coefficients `coefficients`.
    ///
    /// # Panics
    /// When `out` or the coefficients are of another size than the transform, which is a bug of the caller.
    pub fn synthesise(&self, coefficients: &Coefficients, out: &mut Plane, scratch: &mut Scratch) {
        self.synthesise_shifted(coefficients, (0, 0), out, scratch);
    }

    /// Undoes [`Sym8::analyse_shifted`].
    pub fn synthesise_shifted(
        &self,
        coefficients: &Coefficients,
        shift: (usize, usize),
        out: &mut Plane,
        scratch: &mut Scratch,
    ) {
        assert!(out.size() == self.size(), "the plane has the transform's size");
        let mut approximation = std::mem::take(&mut scratch.approximation);
        approximation.clear();
        approximation.extend_from_slice(coefficients.approximation.data());
        if self.levels() == 0 {
            for y in 0..out.height() {
                for x in 0..out.width() {
                    let (to_x, to_y) = ((x + shift.0) % out.width(), (y + shift.1) % out.height());
                    out.set(to_x, to_y, approximation[y * out.size().width + x]);
                }
            }
        }
        for level in (0..self.levels()).rev() {
            let (to, from) = (self.sizes[level], self.sizes[level + 1]);
            let Details { horizontal, vertical, diagonal } = &coefficients.details[level];
            let shift = if level == 0 { shift } else { (0, 0) };
            scratch.low.resize(from.width * to.height, 0.0);
            scratch.high.resize(from.width * to.height, 0.0);
            self.columns_together(
                &approximation,
                horizontal.data(),
                from,
                to.height,
                shift.1,
                &mut scratch.low,
            );
            self.columns_together(
                vertical.data(),
                diagonal.data(),
                from,
                to.height,
                shift.1,
                &mut scratch.high,
            );
            let output = if level == 0 {
                out.data_mut()
            } else {
                approximation.resize(to.area(), 0.0);
                &mut approximation[..]
            };
            self.rows_together(from.width, to, shift.0, scratch, output);
        }
        scratch.approximation = approximation;
    }

    /// Filters along the rows of `input` into `scratch.low` and `scratch.high`, which get half its width.
    fn rows_apart(&self, input: &[f32], size: Size, shift: (usize, usize), scratch: &mut Scratch) {
        let half = size.width.div_ceil(2);
        scratch.low.resize(half * size.height, 0.0);
        scratch.high.resize(half * size.height, 0.0);
        // Even and odd pixels apart, four more periods' pixels on either side.
        scratch.line.resize(2 * (half + 8), 0.0);
        let (even, odd) = scratch.line.split_at_mut(half + 8);
        let turn = shift.0 % size.width;
        for (y, row) in input.chunks_exact(size.width).enumerate() {
            if turn == 0 {
                split(row, &mut even[4..half + 4], &mut odd[4..half + 4]);
            } else {
                scratch.turned.clear();
                scratch.turned.extend_from_slice(&row[turn..]);
                scratch.turned.extend_from_slice(&row[..turn]);
                split(&scratch.turned, &mut even[4..half + 4], &mut odd[4..half + 4]);
            }
            wrap(even, half);
            wrap(odd, half);
            // x[2o+8−j] is even[o+4−t] for j = 2t and odd[o+3−t] for j = 2t+1; both buffers start at −4.
            let rows: [&[f32]; 16] =
                std::array::from_fn(|j| if j % 2 == 0 { &even[8 - j / 2..] } else { &odd[7 - j / 2..] });
            let (low, high) = (&mut scratch.low[y * half..][..half], &mut scratch.high[y * half..][..half]);
            two_sums(&rows, &self.analysis, low, high);
        }
    }

    /// Filters along the columns of `input`, `height` rows of `to.width`, into averages and details.
    fn columns_apart(
        &self,
        input: &[f32],
        height: usize,
        to: Size,
        shift: usize,
        low: &mut [f32],
        high: &mut [f32],
    ) {
        let width = to.width;
        let even = 2 * to.height;
        let row_of = |place: usize| ((place % even).min(height - 1) + shift) % height;
        for start in (0..width).step_by(COLUMNS_AT_A_TIME) {
            let columns = COLUMNS_AT_A_TIME.min(width - start);
            for o in 0..to.height {
                // 16 more periods keep the place positive for planes of few rows.
                let rows: [&[f32]; 16] = std::array::from_fn(|j| {
                    &input[row_of(2 * o + 8 + 16 * even - j) * width + start..][..columns]
                });
                let place = o * width + start;
                two_sums(&rows, &self.analysis, &mut low[place..][..columns], &mut high[place..][..columns]);
            }
        }
    }

    /// Transpose of [`Sym8::columns_apart`]: `height` rows of `from.width` from averages and details.
    fn columns_together(
        &self,
        low: &[f32],
        high: &[f32],
        from: Size,
        height: usize,
        shift: usize,
        out: &mut [f32],
    ) {
        let (width, half) = (from.width, from.height);
        let mut spare = [0.0; COLUMNS_AT_A_TIME];
        for start in (0..width).step_by(COLUMNS_AT_A_TIME) {
            let columns = COLUMNS_AT_A_TIME.min(width - start);
            for k in 0..half {
                let rows: [&[f32]; 16] = std::array::from_fn(|j| {
                    let band = if j < 8 { low } else { high };
                    &band[(k + 4 * half - 4 + j % 8) % half * width + start..][..columns]
                });
                let (first, second) = ((2 * k + 2 * half - 1) % (2 * half), 2 * k);
                let (first_row, second_row) = ((first + shift) % height, (second + shift) % height);
                let (a, b) = if first >= height {
                    (&mut spare[..columns], &mut out[second_row * width + start..][..columns])
                } else {
                    two_rows(out, first_row, second_row, width, start, columns)
                };
                two_sums(&rows, &self.synthesis, a, b);
            }
        }
    }

    /// Transpose of [`Sym8::rows_apart`]: rows of `to.width` from `scratch.low` and `scratch.high`.
    fn rows_together(&self, half: usize, to: Size, shift: usize, scratch: &mut Scratch, out: &mut [f32]) {
        scratch.line.resize(4 * (half + 8), 0.0);
        let (inputs, outputs) = scratch.line.split_at_mut(2 * (half + 8));
        let (low, high) = inputs.split_at_mut(half + 8);
        let (odd, even) = outputs.split_at_mut(half + 8);
        let turn = shift % to.width;
        for (y, row) in out.chunks_exact_mut(to.width).enumerate() {
            low[4..half + 4].copy_from_slice(&scratch.low[y * half..][..half]);
            high[4..half + 4].copy_from_slice(&scratch.high[y * half..][..half]);
            wrap(low, half);
            wrap(high, half);
            let rows: [&[f32]; 16] = std::array::from_fn(|j| if j < 8 { &low[j..] } else { &high[j - 8..] });
            two_sums(&rows, &self.synthesis, &mut odd[..half], &mut even[..half]);
            odd[half] = odd[0]; // x[−1] is x[2·half − 1]
            if turn == 0 {
                join(&even[..half], &odd[1..half + 1], row);
            } else {
                scratch.turned.resize(to.width, 0.0);
                join(&even[..half], &odd[1..half + 1], &mut scratch.turned);
                let (tail, head) = scratch.turned.split_at(to.width - turn);
                row[turn..].copy_from_slice(tail);
                row[..turn].copy_from_slice(head);
            }
        }
    }
}

/// Two different rows of `out`, to be written together.
fn two_rows(
    out: &mut [f32],
    first: usize,
    second: usize,
    width: usize,
    start: usize,
    columns: usize,
) -> (&mut [f32], &mut [f32]) {
    let (upper, lower) = out.split_at_mut(first.max(second) * width);
    let (upper, lower) =
        (&mut upper[first.min(second) * width + start..][..columns], &mut lower[start..][..columns]);
    if first < second { (upper, lower) } else { (lower, upper) }
}

/// The pixels of `row` to `even` and `odd` in turn; the last one twice when their number is odd.
fn split(row: &[f32], even: &mut [f32], odd: &mut [f32]) {
    for ((pair, e), o) in row.chunks_exact(2).zip(even.iter_mut()).zip(odd.iter_mut()) {
        (*e, *o) = (pair[0], pair[1]);
    }
    if let [last] = *row.chunks_exact(2).remainder() {
        (even[row.len() / 2], odd[row.len() / 2]) = (last, last);
    }
}

/// Undoes [`split`].
fn join(even: &[f32], odd: &[f32], row: &mut [f32]) {
    let mut pairs = row.chunks_exact_mut(2);
    for ((pair, e), o) in (&mut pairs).zip(even).zip(odd) {
        (pair[0], pair[1]) = (*e, *o);
    }
    if let [last] = pairs.into_remainder() {
        *last = even[even.len() - 1];
    }
}

/// Continues `line[4..half + 4]` periodically by four on either side.
fn wrap(line: &mut [f32], half: usize) {
    for i in 0..4 {
        line[i] = line[4 + (i + 4 * half - 4) % half];
        line[half + 4 + i] = line[4 + i % half];
    }
}

#[cfg(test)]
mod tests;
