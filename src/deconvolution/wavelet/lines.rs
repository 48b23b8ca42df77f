//! Filter banks of one level along rows and columns.
//!
//! The rows of each pass's output are independent, so a pass can run as parallel tasks of whole
//! rows.

use rayon::prelude::*;

use super::two_sums::two_sums;
use super::{LOW, high};
use crate::frame::Size;

/// Columns filtered at a time along y: sixteen rows of them fit the L1 cache (16 KiB).
const COLUMNS_AT_A_TIME: usize = 256;

/// How a result is written.
#[derive(Debug, Clone, Copy)]
pub enum Put {
    /// It replaces the present values.
    Set,
    /// It is added to the present values.
    Add,
}

impl Put {
    pub(super) fn write(self, to: &mut [f32], from: &[f32]) {
        match self {
            Put::Set => to.copy_from_slice(from),
            Put::Add => {
                for (to, from) in to.iter_mut().zip(from) {
                    *to += from;
                }
            }
        }
    }
}

/// The filters of one level, and the size of parallel tasks.
#[derive(Debug, Clone)]
pub(super) struct Lines {
    analysis: [[f32; 16]; 2],
    synthesis: [[f32; 16]; 2],
    /// Pixels per task; `None` runs on the caller's thread.
    pixels_per_task: Option<usize>,
}

impl Lines {
    pub(super) fn new() -> Self {
        let high = high();
        // Analysis reads rows 2o+8−j, j = 0..16, with the taps in order. Synthesis of pixels 2k−1
        // and 2k reads averages and details k−4..k+4, with odd and even taps respectively.
        let analysis = [LOW.map(|v| v as f32), high.map(|v| v as f32)];
        let every_second = |odd: usize| {
            std::array::from_fn(|j| {
                (if j < 8 { LOW[2 * j + odd] } else { high[2 * (j - 8) + odd] }) as f32
            })
        };
        Lines { analysis, synthesis: [every_second(1), every_second(0)], pixels_per_task: None }
    }

    /// The same filters run in parallel tasks of about `pixels`.
    pub(super) fn parallel(self, pixels: usize) -> Self {
        Lines { pixels_per_task: Some(pixels), ..self }
    }

    /// Filters the rows of `input`, shifted by `shift`, into `low` and `high` of half its width.
    pub(super) fn analyse_rows(
        &self,
        input: &[f32],
        size: Size,
        shift: usize,
        low: &mut Vec<f32>,
        high: &mut Vec<f32>,
    ) {
        let half = size.width.div_ceil(2);
        fit(low, half * size.height);
        fit(high, half * size.height);
        let shift = shift % size.width;
        self.on_two(low, high, half, |first, low, high| {
            // Even and odd pixels separated and extended periodically by four.
            let (mut even, mut odd) = (vec![0.0; half + 8], vec![0.0; half + 8]);
            let mut rotated = vec![0.0; if shift == 0 { 0 } else { size.width }];
            let rows = input[first * size.width..].chunks_exact(size.width);
            for ((row, low), high) in
                rows.zip(low.chunks_exact_mut(half)).zip(high.chunks_exact_mut(half))
            {
                let row = if shift == 0 { row } else { rotate(shift, row, &mut rotated) };
                split(row, &mut even[4..half + 4], &mut odd[4..half + 4]);
                wrap(&mut even, half);
                wrap(&mut odd, half);
                // x[2o+8−j] is even[o+4−t] for j = 2t and odd[o+3−t] for j = 2t+1; both buffers
                // start at −4.
                let rows: [&[f32]; 16] = std::array::from_fn(|j| {
                    if j % 2 == 0 { &even[8 - j / 2..] } else { &odd[7 - j / 2..] }
                });
                two_sums(&rows, &self.analysis, low, high);
            }
        });
    }

    /// Filters the columns of `input`, `height` rows of `to.width` shifted by `shift`, into
    /// averages and details.
    pub(super) fn analyse_columns(
        &self,
        input: &[f32],
        height: usize,
        to: Size,
        shift: usize,
        (low, high): (&mut [f32], &mut [f32]),
    ) {
        let width = to.width;
        let even = 2 * to.height;
        let row_of = |place: usize| ((place % even).min(height - 1) + shift) % height;
        self.on_two(low, high, width, |first, low, high| {
            for start in (0..width).step_by(COLUMNS_AT_A_TIME) {
                let columns = COLUMNS_AT_A_TIME.min(width - start);
                let outputs = low.chunks_exact_mut(width).zip(high.chunks_exact_mut(width));
                for (o, (low, high)) in (first..).zip(outputs) {
                    // 16 periods more keep the index positive for planes of few rows.
                    let rows: [&[f32]; 16] = std::array::from_fn(|j| {
                        &input[row_of(2 * o + 8 + 16 * even - j) * width + start..][..columns]
                    });
                    two_sums(
                        &rows,
                        &self.analysis,
                        &mut low[start..][..columns],
                        &mut high[start..][..columns],
                    );
                }
            }
        });
    }

    /// The transpose of [`Lines::analyse_columns`] without its shift: writes 2 · `from.height`
    /// rows, the last one first.
    pub(super) fn synthesise_columns(
        &self,
        low: &[f32],
        high: &[f32],
        from: Size,
        out: &mut Vec<f32>,
    ) {
        let (width, half) = (from.width, from.height);
        fit(out, 2 * half * width);
        self.on_rows(out, 2 * width, |first, out| {
            for start in (0..width).step_by(COLUMNS_AT_A_TIME) {
                let columns = COLUMNS_AT_A_TIME.min(width - start);
                for (k, pair) in (first..).zip(out.chunks_exact_mut(2 * width)) {
                    let rows: [&[f32]; 16] = std::array::from_fn(|j| {
                        let band = if j < 8 { low } else { high };
                        &band[(k + 4 * half - 4 + j % 8) % half * width + start..][..columns]
                    });
                    // With the last row first, pixels 2k−1 and 2k are adjacent for every k.
                    let (before, here) = pair.split_at_mut(width);
                    let (before, here) =
                        (&mut before[start..][..columns], &mut here[start..][..columns]);
                    two_sums(&rows, &self.synthesis, before, here);
                }
            }
        });
    }

    /// The transpose of [`Lines::analyse_rows`] and of the column shift: rows of `to.width` from
    /// the output of [`Lines::synthesise_columns`] with averages and details of size `from`.
    pub(super) fn synthesise_rows(
        &self,
        (low, high): (&[f32], &[f32]),
        from: Size,
        to: Size,
        shift: (usize, usize),
        (out, put): (&mut [f32], Put),
    ) {
        let half = from.width;
        let (shift, shift_rows) = (shift.0 % to.width, shift.1 % to.height);
        self.on_rows(out, to.width, |first, out| {
            let [mut averages, mut details, mut odd, mut even] =
                [(); 4].map(|()| vec![0.0; half + 8]);
            let mut line = vec![0.0; to.width];
            for (y, row) in (first..).zip(out.chunks_exact_mut(to.width)) {
                let source = ((y + to.height - shift_rows) % to.height + 1) % (2 * from.height);
                averages[4..half + 4].copy_from_slice(&low[source * half..][..half]);
                details[4..half + 4].copy_from_slice(&high[source * half..][..half]);
                wrap(&mut averages, half);
                wrap(&mut details, half);
                let rows: [&[f32]; 16] =
                    std::array::from_fn(|j| if j < 8 { &averages[j..] } else { &details[j - 8..] });
                two_sums(&rows, &self.synthesis, &mut odd[..half], &mut even[..half]);
                odd[half] = odd[0]; // x[−1] is x[2·half − 1]
                join(&even[..half], &odd[1..half + 1], &mut line);
                let (head, tail) = row.split_at_mut(shift);
                let (line_head, line_tail) = line.split_at(to.width - shift);
                put.write(tail, line_head);
                put.write(head, line_tail);
            }
        });
    }

    /// Calls `work` with the first row's index and the rows of each task of `out`.
    fn on_rows(&self, out: &mut [f32], width: usize, work: impl Fn(usize, &mut [f32]) + Sync) {
        match self.rows_per_task(out.len(), width) {
            None => work(0, out),
            Some(rows) => {
                let tasks = out.par_chunks_mut(rows * width).enumerate();
                tasks.for_each(|(n, out)| work(n * rows, out));
            }
        }
    }

    /// [`Lines::on_rows`] for two outputs.
    fn on_two(
        &self,
        a: &mut [f32],
        b: &mut [f32],
        width: usize,
        work: impl Fn(usize, &mut [f32], &mut [f32]) + Sync,
    ) {
        match self.rows_per_task(a.len(), width) {
            None => work(0, a, b),
            Some(rows) => {
                let tasks =
                    a.par_chunks_mut(rows * width).zip(b.par_chunks_mut(rows * width)).enumerate();
                tasks.for_each(|(n, (a, b))| work(n * rows, a, b));
            }
        }
    }

    /// Rows of `width` per task; `None` if `length` numbers fit one task.
    fn rows_per_task(&self, length: usize, width: usize) -> Option<usize> {
        let rows = (self.pixels_per_task? / width.max(1)).max(1);
        (length > rows * width).then_some(rows)
    }
}

/// Resizes `line` without the usual spare capacity.
fn fit(line: &mut Vec<f32>, length: usize) {
    line.reserve_exact(length.saturating_sub(line.len()));
    line.resize(length, 0.0);
}

/// `row` rotated into `rotated`, so that its pixel `shift` comes first.
fn rotate<'a>(shift: usize, row: &[f32], rotated: &'a mut [f32]) -> &'a [f32] {
    let (head, tail) = row.split_at(shift);
    rotated[..tail.len()].copy_from_slice(tail);
    rotated[tail.len()..].copy_from_slice(head);
    rotated
}

/// Separates even and odd pixels of `row`, the last one repeated when their number is odd.
fn split(row: &[f32], even: &mut [f32], odd: &mut [f32]) {
    for ((pair, e), o) in row.chunks_exact(2).zip(even.iter_mut()).zip(odd.iter_mut()) {
        (*e, *o) = (pair[0], pair[1]);
    }
    if let [last] = *row.chunks_exact(2).remainder() {
        (even[row.len() / 2], odd[row.len() / 2]) = (last, last);
    }
}

/// The inverse of [`split`].
fn join(even: &[f32], odd: &[f32], row: &mut [f32]) {
    let mut pairs = row.chunks_exact_mut(2);
    for ((pair, e), o) in (&mut pairs).zip(even).zip(odd) {
        (pair[0], pair[1]) = (*e, *o);
    }
    if let [last] = pairs.into_remainder() {
        *last = even[even.len() - 1];
    }
}

/// Extends `line[4..half + 4]` periodically by four on either side.
fn wrap(line: &mut [f32], half: usize) {
    for i in 0..4 {
        line[i] = line[4 + (i + 4 * half - 4) % half];
        line[half + 4 + i] = line[4 + i % half];
    }
}
