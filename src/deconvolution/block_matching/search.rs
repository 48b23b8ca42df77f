//! Search for similar blocks.

use rayon::prelude::*;

use super::transform::SIDE;
use crate::frame::instructions::{Kernel, multiply_add, run_fastest};
use crate::frame::{Plane, Size};

/// Maximum number of blocks in a group that the filter supports.
const GROUP_MAX: usize = 16;

/// Rows of reference blocks per task, independent of the number of threads.
pub(super) const ROWS_A_TASK: usize = 8;

/// Parameters of the search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Search {
    /// Distance between reference blocks, pixels, at least 1.
    pub step_px: usize,
    /// Maximum distance of a block from its reference along x and y, pixels.
    pub reach_px: usize,
    /// Maximum size of a group, the reference included; at most 16, rounded down to a power of two.
    pub group_max: usize,
    /// Maximum mean square difference of a block from its reference, grey levels².
    pub difference_max: f32,
}

/// Upper left corners of the blocks of a group, the reference first, then by similarity.
pub(super) type Members = [(u32, u32)];

/// Groups of similar blocks over a picture.
#[derive(Debug, Clone)]
pub struct Groups {
    size: Size,
    tasks: Vec<Task>,
}

/// The groups of several rows of references.
#[derive(Debug, Clone)]
pub(super) struct Task {
    /// First row of pixels that its blocks can cover.
    pub(super) first_row: usize,
    /// Number of rows of pixels that its blocks can cover.
    pub(super) rows: usize,
    places: Vec<(u32, u32)>,
    /// End of each group in `places`.
    ends: Vec<usize>,
    /// Groups per row of references.
    across: usize,
}

impl Task {
    /// The groups, in order.
    pub(super) fn groups(&self) -> impl Iterator<Item = &Members> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts.zip(&self.ends).map(|(start, &end)| &self.places[start..end])
    }
}

impl Groups {
    /// Finds groups of similar blocks in `picture`, with the grid of references displaced by
    /// `offset` pixels. There are none when the picture is smaller than a block.
    pub fn find(picture: &Plane, search: Search, offset: usize) -> Groups {
        let size = picture.size();
        let (across, down) =
            (grid(size.width, search.step_px, offset), grid(size.height, search.step_px, offset));
        let tasks = down.par_chunks(ROWS_A_TASK).map(|rows| {
            let first_row = rows[0].saturating_sub(search.reach_px);
            let last = (rows[rows.len() - 1] + search.reach_px).min(size.height - SIDE);
            let mut task = Task {
                first_row,
                rows: last + SIDE - first_row,
                places: Vec::with_capacity(rows.len() * across.len() * search.group_max),
                ends: Vec::with_capacity(rows.len() * across.len()),
                across: across.len(),
            };
            run_fastest(SearchTask { picture, search, rows, across: &across, task: &mut task });
            task
        });
        Groups { size, tasks: if across.is_empty() { Vec::new() } else { tasks.collect() } }
    }

    /// Every second of these groups, in a quincunx, and those at the borders left and right: with
    /// references half a block apart they still cover the picture.
    #[must_use]
    pub fn thinned(&self) -> Groups {
        let thinned = |task: &Task| {
            let mut thin = Task { places: Vec::new(), ends: Vec::new(), ..*task };
            for (n, group) in task.groups().enumerate() {
                let (row, column) = (n / task.across, n % task.across);
                let is_border = column == 0 || column + 1 == task.across;
                if is_border || (row + column).is_multiple_of(2) {
                    thin.places.extend(group);
                    thin.ends.push(thin.places.len());
                }
            }
            thin
        };
        Groups { size: self.size, tasks: self.tasks.iter().map(thinned).collect() }
    }

    /// Size of the picture.
    pub fn size(&self) -> Size {
        self.size
    }

    pub(super) fn tasks(&self) -> &[Task] {
        &self.tasks
    }
}

/// Positions of references along one axis: every `step` pixels, and the first and last position.
pub(super) fn grid(length: usize, step: usize, offset: usize) -> Vec<usize> {
    let Some(last) = length.checked_sub(SIDE) else { return Vec::new() };
    let step = step.max(1);
    let mut places: Vec<usize> = (offset % step..last).step_by(step).collect();
    if places.first() != Some(&0) && last > 0 {
        places.insert(0, 0);
    }
    places.push(last);
    places
}

/// Number of adjacent blocks compared at a time.
const AT_A_TIME: usize = 8;

struct SearchTask<'a> {
    picture: &'a Plane,
    search: Search,
    rows: &'a [usize],
    across: &'a [usize],
    task: &'a mut Task,
}

impl Kernel for SearchTask<'_> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let SearchTask { picture, search, rows, across, task } = self;
        let area = (SIDE * SIDE) as f32;
        let group_max = floor_power_of_two(search.group_max.min(GROUP_MAX));
        let mut found: Vec<SimilarBlock> = Vec::with_capacity(group_max + 1);
        for &y in rows {
            for &x in across {
                let reference = block(picture, x, y);
                found.clear();
                found.push((-1.0, (x as u32, y as u32)));
                let mut worst = search.difference_max * area;
                let near = |at: usize, length: usize| {
                    at.saturating_sub(search.reach_px)
                        ..(at + search.reach_px).min(length - SIDE) + 1
                };
                let columns = near(x, picture.width());
                for v in near(y, picture.height()) {
                    let mut u = columns.start;
                    while u < columns.end {
                        let mut compared = [f32::INFINITY; AT_A_TIME];
                        let is_row = u + AT_A_TIME <= columns.end;
                        if is_row {
                            compared = differences::<FUSED>(&reference, picture, u, v);
                        } else {
                            compared[0] = difference::<FUSED>(&reference, picture, u, v);
                        }
                        if is_any_within(&compared, worst) {
                            for (place, difference) in (u..).zip(compared) {
                                if difference <= worst && (place, v) != (x, y) {
                                    let place = (place as u32, v as u32);
                                    worst =
                                        insert(&mut found, group_max, (difference, place), worst);
                                }
                            }
                        }
                        u += if is_row { AT_A_TIME } else { 1 };
                    }
                }
                let members = floor_power_of_two(found.len());
                task.places.extend(found[..members].iter().map(|&(_, place)| place));
                task.ends.push(task.places.len());
            }
        }
    }
}

pub(super) fn floor_power_of_two(n: usize) -> usize {
    1 << n.max(1).ilog2()
}

#[inline(always)]
fn block(picture: &Plane, x: usize, y: usize) -> [[f32; SIDE]; SIDE] {
    std::array::from_fn(|row| {
        let from = &picture.row(y + row)[x..][..SIDE];
        std::array::from_fn(|column| from[column])
    })
}

/// A block's difference from the reference, and its place.
type SimilarBlock = (f32, (u32, u32));

/// Inserts `block` into `found`, in order and behind its equals, unless `most` blocks are at least
/// as similar. Returns the largest difference that the next block may have: `worst` while `found`
/// holds fewer than `most`.
#[inline(always)]
fn insert(found: &mut Vec<SimilarBlock>, most: usize, block: SimilarBlock, worst: f32) -> f32 {
    if found.len() == most {
        if found[most - 1].0 <= block.0 {
            return worst;
        }
        found.pop();
    }
    let mut place = found.len();
    found.push(block);
    // Moved one by one: a few elements are not worth a call to memmove.
    while place > 0 && found[place - 1].0 > block.0 {
        found[place] = found[place - 1];
        place -= 1;
    }
    found[place] = block;
    if found.len() == most { found[most - 1].0 } else { worst }
}

/// Whether one of `values` is at most `most`.
#[inline(always)]
fn is_any_within(values: &[f32; AT_A_TIME], most: f32) -> bool {
    let mut is_any = false;
    for value in values {
        is_any |= *value <= most;
    }
    is_any
}

/// [`difference`] of eight blocks, the first at (`x`, `y`) and the others to its right, one in each
/// lane; the same sums in the same order.
#[inline(always)]
fn differences<const FUSED: bool>(
    reference: &[[f32; SIDE]; SIDE],
    picture: &Plane,
    x: usize,
    y: usize,
) -> [f32; AT_A_TIME] {
    const SEEN: usize = SIDE + AT_A_TIME - 1;
    let mut sums = [[0.0f32; AT_A_TIME]; SIDE];
    let width = picture.width();
    let from = &picture.data()[y * width + x..][..(SIDE - 1) * width + SEEN];
    for (row, wanted) in reference.iter().enumerate() {
        let found = &from[row * width..][..SEEN];
        for column in 0..SIDE {
            for lane in 0..AT_A_TIME {
                let apart = wanted[column] - found[column + lane];
                sums[column][lane] = multiply_add::<FUSED>(apart, apart, sums[column][lane]);
            }
        }
    }
    let [a, b, c, d, e, f, g, h] = sums;
    std::array::from_fn(|n| ((a[n] + e[n]) + (c[n] + g[n])) + ((b[n] + f[n]) + (d[n] + h[n])))
}

/// Sum of squared differences between `reference` and the block at (`x`, `y`).
#[inline(always)]
fn difference<const FUSED: bool>(
    reference: &[[f32; SIDE]; SIDE],
    picture: &Plane,
    x: usize,
    y: usize,
) -> f32 {
    let mut sums = [0.0f32; SIDE];
    let width = picture.width();
    let from = &picture.data()[y * width + x..][..(SIDE - 1) * width + SIDE];
    for (row, wanted) in reference.iter().enumerate() {
        let found = &from[row * width..][..SIDE];
        for ((sum, w), f) in sums.iter_mut().zip(wanted).zip(found) {
            let apart = w - f;
            *sum = multiply_add::<FUSED>(apart, apart, *sum);
        }
    }
    let [a, b, c, d, e, f, g, h] = sums;
    ((a + e) + (c + g)) + ((b + f) + (d + h))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn references_reach_both_borders_at_every_offset() {
        assert_eq!(grid(20, 5, 0), vec![0, 5, 10, 12]);
        assert_eq!(grid(20, 5, 7), vec![0, 2, 7, 12]);
        assert_eq!(grid(8, 3, 2), vec![0]);
        assert_eq!(grid(9, 3, 2), vec![0, 1]);
        assert!(grid(7, 3, 0).is_empty());
    }

    #[test]
    fn half_of_the_groups_still_cover_the_picture() {
        let search = Search { step_px: 4, reach_px: 0, group_max: 1, difference_max: 0.0 };
        for (width, height) in [(8, 8), (12, 16), (13, 47), (64, 83), (81, 72)] {
            for turn in 0..2 {
                let all = Groups::find(&Plane::zeros(Size::new(width, height)), search, turn);
                let thin = all.thinned();
                let mut covered = vec![false; width * height];
                for &(x, y) in thin.tasks().iter().flat_map(|task| task.groups().flatten()) {
                    for n in 0..SIDE * SIDE {
                        covered[(y as usize + n / SIDE) * width + x as usize + n % SIDE] = true;
                    }
                }
                assert!(covered.iter().all(|covered| *covered), "{width}×{height}, turn {turn}");
                let count = |of: &Groups| of.tasks().iter().map(|t| t.ends.len()).sum::<usize>();
                assert!(width < 60 || count(&thin) <= count(&all) * 3 / 5);
            }
        }
    }

    #[test]
    fn a_repeated_pattern_is_found_where_it_repeats() {
        let picture = Plane::from_fn(Size::new(48, 40), |x, y| {
            ((x % 12) * 17 + (y % 10) * 23) as f32 + if x < 24 { 0.0 } else { 3.0 }
        });
        let search = Search { step_px: 4, reach_px: 14, group_max: 16, difference_max: 1.0 };
        let groups = Groups::find(&picture, search, 0);
        assert_eq!(groups.tasks().len(), 2);
        let first: Vec<_> = groups.tasks()[0].groups().next().unwrap().to_vec();
        // The same pixels are at (12, 0), (0, 10) and (12, 10), and nowhere else within reach.
        assert_eq!(first, vec![(0, 0), (12, 0), (0, 10), (12, 10)]);
        for task in groups.tasks() {
            for &(_, y) in task.groups().flatten() {
                assert!(
                    y as usize >= task.first_row && y as usize + SIDE <= task.first_row + task.rows
                );
            }
        }
    }
}
