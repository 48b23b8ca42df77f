//! Interpolation in tables of numbers at even steps.

/// `table` interpolated linearly at step `at`, extrapolated beyond its ends.
#[inline(always)]
pub fn at_step(table: &[f32], at: f32) -> f32 {
    let below = (at as usize).min(table.len() - 2);
    table[below] + (at - below as f32) * (table[below + 1] - table[below])
}

/// Fractional step at which a rising `table` reaches `value`; the nearer end if it does not.
pub fn step_of(table: &[f32], value: f32) -> f32 {
    let above = table.partition_point(|&v| v <= value);
    let (Some(below), Some(&high)) = (above.checked_sub(1), table.get(above)) else {
        return if above == 0 { 0.0 } else { (table.len() - 1) as f32 };
    };
    below as f32 + (value - table[below]) / (high - table[below])
}
