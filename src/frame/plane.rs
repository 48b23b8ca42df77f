//! A row-major grid of numbers.

use std::ops::Range;

use serde::{Deserialize, Serialize};

/// Width and height in pixels.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Size {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

impl Size {
    /// A size of `width` × `height` pixels.
    pub const fn new(width: usize, height: usize) -> Self {
        Size { width, height }
    }

    /// Number of pixels.
    pub const fn area(self) -> usize {
        self.width * self.height
    }
}

impl std::fmt::Display for Size {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}×{}", self.width, self.height)
    }
}

/// A rectangle of pixels inside a larger grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Rect {
    /// First column.
    pub x: usize,
    /// First row.
    pub y: usize,
    /// Width and height.
    pub size: Size,
}

impl Rect {
    /// Splits the rectangle into `columns` × `rows` parts, row by row, whose sides differ by at
    /// most a pixel.
    pub fn parts(self, columns: usize, rows: usize) -> impl Iterator<Item = Rect> {
        let part = |n: usize, of: usize, length: usize| n * length / of..(n + 1) * length / of;
        (0..columns * rows).map(move |n| {
            let across = part(n % columns, columns, self.size.width);
            let down = part(n / columns, rows, self.size.height);
            let size = Size::new(across.len(), down.len());
            Rect { x: self.x + across.start, y: self.y + down.start, size }
        })
    }

    /// Whether `part` lies wholly inside this rectangle.
    pub fn contains(self, part: Rect) -> bool {
        let within = |inner: Range<usize>, outer: Range<usize>| {
            inner.start >= outer.start && inner.end <= outer.end
        };
        within(part.columns(), self.columns()) && within(part.rows(), self.rows())
    }

    /// Range of columns.
    pub fn columns(self) -> Range<usize> {
        self.x..self.x + self.size.width
    }

    /// Range of rows.
    pub fn rows(self) -> Range<usize> {
        self.y..self.y + self.size.height
    }
}

/// Position of a rig's photos on its sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct PhotoGrid {
    /// The whole sensor.
    pub sensor: Size,
    /// The restored part, inside the sensor.
    pub photo: Rect,
    /// Side of the squares of pixels in the known gain pattern, from which a photo's orientation
    /// and place on the sensor are found; `None` if the pattern was not measured.
    pub pattern_px: Option<usize>,
}

/// The grid of photos that cover the whole sensor.
impl From<Size> for PhotoGrid {
    fn from(size: Size) -> PhotoGrid {
        PhotoGrid { sensor: size, photo: Rect { x: 0, y: 0, size }, pattern_px: None }
    }
}

/// A grid of numbers, row-major, height × width; empty by default.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Plane<T = f32> {
    size: Size,
    data: Vec<T>,
}

impl<T: Copy + Default> Plane<T> {
    /// A plane of `T::default()` (zero for numbers).
    pub fn zeros(size: Size) -> Self {
        Plane { size, data: vec![T::default(); size.area()] }
    }

    /// A plane with `value` everywhere.
    pub fn filled(size: Size, value: T) -> Self {
        Plane { size, data: vec![value; size.area()] }
    }

    /// A plane from row-major `data`; `None` when its length is not `size.area()`.
    pub fn from_vec(size: Size, data: Vec<T>) -> Option<Self> {
        (data.len() == size.area()).then_some(Plane { size, data })
    }

    /// A plane computed pixel by pixel from column and row.
    pub fn from_fn(size: Size, mut value: impl FnMut(usize, usize) -> T) -> Self {
        let mut data = Vec::with_capacity(size.area());
        for y in 0..size.height {
            for x in 0..size.width {
                data.push(value(x, y));
            }
        }
        Plane { size, data }
    }

    /// Width and height.
    pub fn size(&self) -> Size {
        self.size
    }

    /// Pixels in a row.
    pub fn width(&self) -> usize {
        self.size.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.size.height
    }

    /// All pixels, row-major.
    pub fn data(&self) -> &[T] {
        &self.data
    }

    /// All pixels, row-major, mutable.
    pub fn data_mut(&mut self) -> &mut [T] {
        &mut self.data
    }

    /// Returns the pixels.
    pub fn into_vec(self) -> Vec<T> {
        self.data
    }

    /// Row `y`.
    pub fn row(&self, y: usize) -> &[T] {
        &self.data[y * self.size.width..][..self.size.width]
    }

    /// Row `y`, mutable.
    pub fn row_mut(&mut self, y: usize) -> &mut [T] {
        &mut self.data[y * self.size.width..][..self.size.width]
    }

    /// Pixel in column `x`, row `y`.
    pub fn at(&self, x: usize, y: usize) -> T {
        self.data[y * self.size.width + x]
    }

    /// Sets the pixel in column `x`, row `y`.
    pub fn set(&mut self, x: usize, y: usize, value: T) {
        self.data[y * self.size.width + x] = value;
    }

    /// Applies `change` to each pixel.
    pub fn map<U>(&self, change: impl FnMut(T) -> U) -> Plane<U> {
        Plane { size: self.size, data: self.data.iter().copied().map(change).collect() }
    }

    /// Changes each pixel by the same pixel of `other`.
    pub fn update<U: Copy>(&mut self, other: &Plane<U>, mut change: impl FnMut(&mut T, U)) {
        debug_assert_eq!(self.size, other.size);
        self.data.iter_mut().zip(&other.data).for_each(|(own, &other)| change(own, other));
    }

    /// Turns the plane by half: the last pixel becomes the first.
    pub fn turn_by_half(&mut self) {
        self.data.reverse();
    }

    /// Copies the pixels in `rect`, which must lie inside the plane.
    pub fn crop(&self, rect: Rect) -> Plane<T> {
        let mut data = Vec::with_capacity(rect.size.area());
        for y in rect.rows() {
            data.extend_from_slice(&self.row(y)[rect.columns()]);
        }
        Plane { size: rect.size, data }
    }
}

impl Plane<f32> {
    /// Adds `weight` × `other` pixel by pixel.
    pub fn add_scaled(&mut self, weight: f32, other: &Plane<f32>) {
        self.update(other, |own, other| *own += weight * other);
    }

    /// Multiplies every pixel by `factor`.
    pub fn scale(&mut self, factor: f32) {
        self.data.iter_mut().for_each(|value| *value *= factor);
    }

    /// Multiplies by `other` pixel by pixel.
    pub fn multiply(&mut self, other: &Plane<f32>) {
        self.update(other, |own, other| *own *= other);
    }

    /// Dot product with `other`, accumulated in `f64`.
    pub fn dot(&self, other: &Plane<f32>) -> f64 {
        debug_assert_eq!(self.size, other.size);
        let mut total = 0.0f64;
        for (a, b) in self.data.chunks(1024).zip(other.data.chunks(1024)) {
            let mut part = [0.0f32; 16];
            let (mut ia, mut ib) = (a.chunks_exact(16), b.chunks_exact(16));
            for (x, y) in (&mut ia).zip(&mut ib) {
                for k in 0..16 {
                    part[k] += x[k] * y[k];
                }
            }
            total += part.iter().map(|&p| f64::from(p)).sum::<f64>();
            total += ia
                .remainder()
                .iter()
                .zip(ib.remainder())
                .map(|(&x, &y)| f64::from(x * y))
                .sum::<f64>();
        }
        total
    }

    /// Mean of all pixels, accumulated in `f64`.
    pub fn mean(&self) -> f64 {
        self.data.iter().map(|&v| f64::from(v)).sum::<f64>() / self.data.len().max(1) as f64
    }

    /// Root mean square of all pixels.
    pub fn rms(&self) -> f64 {
        (self.dot(self) / self.data.len().max(1) as f64).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dot_agrees_with_the_plain_sum() {
        let a = Plane::from_fn(Size::new(37, 29), |x, y| (x * 7 + y * 3) as f32 * 0.01 - 1.0);
        let b = Plane::from_fn(Size::new(37, 29), |x, y| ((x * x + y) % 11) as f32 - 5.0);
        let plain: f64 =
            a.data().iter().zip(b.data()).map(|(&x, &y)| f64::from(x) * f64::from(y)).sum();
        assert!((a.dot(&b) - plain).abs() < 1e-3 * plain.abs().max(1.0));
    }

    #[test]
    fn crop_copies_the_rectangle() {
        let p = Plane::from_fn(Size::new(8, 6), |x, y| (10 * y + x) as f32);
        let c = p.crop(Rect { x: 2, y: 3, size: Size::new(2, 2) });
        assert_eq!(c.data(), &[32.0, 33.0, 42.0, 43.0]);
    }

    #[test]
    fn a_vector_of_the_wrong_length_is_refused() {
        assert!(Plane::from_vec(Size::new(2, 2), vec![0.0f32; 3]).is_none());
    }
}
