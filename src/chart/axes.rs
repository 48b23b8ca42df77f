//! A panel's axes: seconds on a logarithmic scale across, a measure upwards.

use super::drawing::{Anchor, Drawing, FAINT, INK, Stroke};

/// Scale of a measure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ValueScale {
    /// Proportional to the value.
    Linear,
    /// Logarithmic in the distance from 1, for SSIM: differences of good results stay visible.
    LogBelowOne,
}

/// Tick values on a [`ValueScale::LogBelowOne`] axis.
const BELOW_ONE: [f64; 14] =
    [0.2, 0.4, 0.5, 0.6, 0.7, 0.75, 0.8, 0.85, 0.9, 0.92, 0.94, 0.96, 0.98, 0.99];

/// Field of a panel on the sheet, and the values at its ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axes {
    /// Left and right end on the sheet.
    pub across: [f64; 2],
    /// Upper and lower end on the sheet.
    pub down: [f64; 2],
    /// Least and most seconds.
    pub seconds: [f64; 2],
    /// Least and largest value of the measure.
    pub values: [f64; 2],
    /// Scale of the measure.
    pub scale: ValueScale,
}

impl Axes {
    /// Horizontal position of `seconds` on the sheet, clamped to the field.
    pub fn x(&self, seconds: f64) -> f64 {
        let [from, to] = self.seconds.map(f64::ln);
        let share = (seconds.max(1e-6).ln() - from) / (to - from);
        self.across[0] + share.clamp(0.0, 1.0) * (self.across[1] - self.across[0])
    }

    /// Vertical position of `value` on the sheet, clamped to the field.
    pub fn y(&self, value: f64) -> f64 {
        let scaled = |value: f64| match self.scale {
            ValueScale::Linear => value,
            ValueScale::LogBelowOne => -(1.0 - value).max(1e-3).ln(),
        };
        let [from, to] = self.values.map(scaled);
        let share = (scaled(value) - from) / (to - from);
        self.down[1] - share.clamp(0.0, 1.0) * (self.down[1] - self.down[0])
    }

    /// Draws the grid and the axes; the measure's axis is numbered only if `numbers`.
    pub fn draw(&self, sheet: &mut Drawing, numbers: bool) {
        let ([left, right], [top, bottom]) = (self.across, self.down);
        let narrow = (right - left) / (self.seconds[1] / self.seconds[0]).log10() < 120.0;
        for decade in -3..5 {
            for step in [1.0, 2.0, 5.0] {
                let seconds = step * 10f64.powi(decade);
                if !(self.seconds[0]..=self.seconds[1]).contains(&seconds) {
                    continue;
                }
                let x = self.x(seconds);
                sheet.line(&[[x, top], [x, bottom]], Stroke::new(FAINT, 1.0));
                if step == 1.0 || !narrow {
                    let words = format!("{seconds:.*}", (-decade).max(0) as usize);
                    sheet.words(&words, [x, bottom + 16.0], Anchor::Middle, 12.0);
                }
            }
        }
        let (ticks, decimals) = self.ticks();
        for tick in ticks {
            let y = self.y(tick);
            sheet.line(&[[left, y], [right, y]], Stroke::new(FAINT, 1.0));
            if numbers {
                let words = format!("{tick:.decimals$}");
                sheet.words(&words, [left - 7.0, y + 4.0], Anchor::End, 12.0);
            }
        }
        sheet.line(&[[left, top], [left, bottom], [right, bottom]], Stroke::new(INK, 1.0));
    }

    /// Tick values on the measure's axis, and their number of decimals.
    fn ticks(&self) -> (Vec<f64>, usize) {
        let [from, to] = self.values;
        if self.scale == ValueScale::LogBelowOne {
            let within = BELOW_ONE.into_iter().filter(|tick| (from..=to).contains(tick));
            return (within.collect(), 2);
        }
        let steps = [0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0];
        let step = steps.into_iter().find(|step| (to - from) / step < 9.0).unwrap_or(10.0);
        let numbers = (from / step).ceil() as i64..=(to / step).floor() as i64;
        let decimals = (-f64::log10(step)).ceil().max(0.0) as usize;
        (numbers.map(|n| n as f64 * step).collect(), decimals)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_grow_with_seconds_and_values_and_stop_at_the_ends() {
        let axes = Axes {
            across: [10.0, 110.0],
            down: [0.0, 50.0],
            seconds: [0.1, 10.0],
            values: [0.8, 1.0],
            scale: ValueScale::Linear,
        };
        assert_eq!([axes.x(0.01), axes.x(0.1), axes.x(1e3)], [10.0, 10.0, 110.0]);
        assert!((axes.x(1.0) - 60.0).abs() < 1e-9 && (axes.y(0.9) - 25.0).abs() < 1e-9);
        assert_eq!([axes.y(0.5), axes.y(1.5)], [50.0, 0.0]);
        let bent = Axes { values: [0.5, 0.98], scale: ValueScale::LogBelowOne, ..axes };
        assert!((bent.y(0.9) - 25.0).abs() < 1e-9, "half of 25 times in distance");
    }
}
