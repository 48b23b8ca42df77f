//! Filter banks of one level along rows and columns.
//!
//! Rows filtered along x are kept in a ring of as many as the filters along y read, so that a plane
//! passes the memory once. The rows of the output are independent, so a pass can run as parallel
//! tasks of whole rows.

use rayon::prelude::*;

use super::two_sums::two_sums;
use super::{LOW, high};
use crate::frame::Size;

/// Number of taps of a filter.
const TAPS: usize = 16;

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

    /// Filters `input`, of size `from` and shifted by `shift`, along both axes into `bands` of size
    /// `to`: averages, then horizontal, vertical and diagonal details.
    pub(super) fn analyse(
        &self,
        input: &[f32],
        (from, to): (Size, Size),
        shift: (usize, usize),
        bands: [&mut [f32]; 4],
    ) {
        let Size { width: half, height } = to;
        let (shift_x, shift_y) = (shift.0 % from.width, shift.1);
        // 16 periods more keep the index positive for planes of few rows.
        let last = |o: usize| 2 * o + 8 + TAPS * 2 * height;
        let row_of = |place: usize| {
            ((place % (2 * height)).min(from.height - 1) + shift_y) % from.height * from.width
        };
        self.on_rows(bands, half, |first, [averages, horizontal, vertical, diagonal]| {
            let mut line = RowFilter::new(from.width, half);
            let [mut low, mut high] = [(); 2].map(|()| vec![0.0; TAPS * half]);
            let upper = averages.chunks_exact_mut(half).zip(horizontal.chunks_exact_mut(half));
            let lower = vertical.chunks_exact_mut(half).zip(diagonal.chunks_exact_mut(half));
            for (o, (upper, lower)) in (first..).zip(upper.zip(lower)) {
                let fresh = if o == first { TAPS } else { 2 };
                for place in last(o) + 1 - fresh..=last(o) {
                    let at = place % TAPS * half..(place % TAPS + 1) * half;
                    let row = &input[row_of(place)..][..from.width];
                    line.filter(self, row, shift_x, (&mut low[at.clone()], &mut high[at]));
                }
                for (ring, (first, second)) in [(&low, upper), (&high, lower)] {
                    let rows: [&[f32]; TAPS] =
                        std::array::from_fn(|j| &ring[(last(o) - j) % TAPS * half..][..half]);
                    two_sums(&rows, &self.analysis, first, second);
                }
            }
        });
    }

    /// The transpose of [`Lines::analyse`].
    pub(super) fn synthesise(
        &self,
        bands: [&[f32]; 4],
        (from, to): (Size, Size),
        shift: (usize, usize),
        (out, put): (&mut [f32], Put),
    ) {
        let Size { width: half, height } = from;
        let (shift, shift_rows) = (shift.0 % to.width, shift.1 % to.height);
        self.on_rows([out], to.width, |first, [out]| {
            // Rows 2k−1 and 2k of averages and details.
            let mut pairs = [(); 2].map(|()| vec![0.0; 2 * half]);
            let mut filtered = None;
            let [mut averages, mut details, mut odd, mut even] =
                [(); 4].map(|()| vec![0.0; half + 8]);
            let mut line = vec![0.0; to.width];
            for (y, row) in (first..).zip(out.chunks_exact_mut(to.width)) {
                let source = ((y + to.height - shift_rows) % to.height + 1) % (2 * height);
                let k = source / 2;
                if filtered.replace(k) != Some(k) {
                    for (pair, bands) in pairs.iter_mut().zip(bands.chunks_exact(2)) {
                        let rows: [&[f32]; TAPS] = std::array::from_fn(|j| {
                            &bands[j / 8][(k + 4 * height - 4 + j % 8) % height * half..][..half]
                        });
                        let (before, here) = pair.split_at_mut(half);
                        two_sums(&rows, &self.synthesis, before, here);
                    }
                }
                for (line, pair) in [&mut averages, &mut details].into_iter().zip(&pairs) {
                    line[4..half + 4].copy_from_slice(&pair[source % 2 * half..][..half]);
                    wrap(line, half);
                }
                let rows: [&[f32]; TAPS] =
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

    /// Calls `work` with the first row's index and the rows of each task of the planes `out`.
    fn on_rows<const N: usize>(
        &self,
        mut out: [&mut [f32]; N],
        width: usize,
        work: impl Fn(usize, [&mut [f32]; N]) + Sync,
    ) {
        let Some(rows) = self.rows_per_task(out[0].len(), width) else { return work(0, out) };
        let mut tasks = Vec::new();
        while !out[0].is_empty() {
            let length = (rows * width).min(out[0].len());
            tasks.push(out.each_mut().map(|rest| rest.split_off_mut(..length).unwrap_or_default()));
        }
        tasks.into_par_iter().enumerate().for_each(|(n, out)| work(n * rows, out));
    }

    /// Rows of `width` per task; `None` if `length` numbers fit one task.
    fn rows_per_task(&self, length: usize, width: usize) -> Option<usize> {
        let rows = (self.pixels_per_task? / width.max(1)).max(1);
        (length > rows * width).then_some(rows)
    }
}

/// Filters along one row, with its buffers.
struct RowFilter {
    /// Even and odd pixels, extended periodically by four.
    even: Vec<f32>,
    odd: Vec<f32>,
    rotated: Vec<f32>,
}

impl RowFilter {
    fn new(width: usize, half: usize) -> Self {
        let [even, odd] = [(); 2].map(|()| vec![0.0; half + 8]);
        RowFilter { even, odd, rotated: vec![0.0; width] }
    }

    /// Filters `row`, shifted by `shift`, into averages and details.
    fn filter(
        &mut self,
        lines: &Lines,
        row: &[f32],
        shift: usize,
        (low, high): (&mut [f32], &mut [f32]),
    ) {
        let RowFilter { even, odd, rotated } = self;
        let half = low.len();
        let row = if shift == 0 { row } else { rotate(shift, row, rotated) };
        split(row, &mut even[4..half + 4], &mut odd[4..half + 4]);
        wrap(even, half);
        wrap(odd, half);
        // x[2o+8−j] is even[o+4−t] for j = 2t and odd[o+3−t] for j = 2t+1; both buffers start
        // at −4.
        let rows: [&[f32]; TAPS] =
            std::array::from_fn(
                |j| {
                    if j % 2 == 0 { &even[8 - j / 2..] } else { &odd[7 - j / 2..] }
                },
            );
        two_sums(&rows, &lines.analysis, low, high);
    }
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
