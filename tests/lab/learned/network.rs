//! The network of the learned prior: 3×3 convolutions over cells of 32 numbers, as `prior/net.py`
//! defines it.

use half::f16;
use relens::frame::instructions::{Kernel, multiply_add, run_fastest};

/// Number of values in a cell between layers.
const WIDTH: usize = 32;
/// Number of vectors of eight values in a cell.
const VECTORS: usize = WIDTH / 8;
/// Number of features of a cell, which are the input of the first layer.
const FEATURES: usize = 18;
/// Number of outputs of a cell: gates and additions of its twelve coefficients.
const OUTPUTS: usize = 24;
/// Number of residual pairs of layers, between the first and the last layer.
const PAIRS: usize = 3;
/// Number of cells on every side of a cell on which its outputs depend: one per layer.
pub(super) const REACH: usize = 2 + 2 * PAIRS;
/// Cells of a row computed in one pass over the weights, in eight registers of AVX2; three take
/// twice as long.
const GROUP: usize = 2;
/// End of a file's header.
const HEADER_END: &[u8] = b"---\n";

/// A cell's numbers; unused ones are 0.
pub(super) type Cell = [f32; WIDTH];

/// A rectangle of cells, by rows.
pub(super) struct Cells {
    /// Columns.
    pub(super) width: usize,
    /// Rows.
    pub(super) height: usize,
    /// The cells, row by row.
    pub(super) cells: Vec<Cell>,
}

impl Cells {
    /// Cells of zeros.
    pub(super) fn new(width: usize, height: usize) -> Cells {
        Cells { width, height, cells: vec![[0.0; WIDTH]; width * height] }
    }
}

/// One 3×3 convolution.
struct Layer {
    inputs: usize,
    /// Weights of the outputs, for each of nine places and each input.
    weights: Vec<Cell>,
    bias: Cell,
}

/// The weights of all layers.
pub(super) struct Network {
    layers: Vec<Layer>,
}

impl Network {
    /// The network of `bytes`: a text header that ends with a line `---`, then each layer's weights
    /// as \[output]\[input]\[3]\[3] and its bias, 16-bit floating-point numbers, little-endian.
    /// `None` if there are too few or too many numbers.
    pub(super) fn parse(bytes: &[u8]) -> Option<Network> {
        let header = bytes.windows(HEADER_END.len()).position(|end| end == HEADER_END)?;
        let (numbers, rest) = bytes[header + HEADER_END.len()..].as_chunks::<2>();
        let mut numbers = numbers.iter().map(|bytes| f16::from_le_bytes(*bytes).to_f32());
        let inner = std::iter::repeat_n((WIDTH, WIDTH), 2 * PAIRS);
        let shapes = [(FEATURES, WIDTH)].into_iter().chain(inner).chain([(WIDTH, OUTPUTS)]);
        let mut layers = Vec::new();
        for (inputs, outputs) in shapes {
            let mut weights = vec![[0.0; WIDTH]; 9 * inputs];
            for n in 0..9 * inputs * outputs {
                let (output, input, place) = (n / 9 / inputs, n / 9 % inputs, n % 9);
                weights[place * inputs + input][output] = numbers.next()?;
            }
            let mut bias = [0.0; WIDTH];
            for value in &mut bias[..outputs] {
                *value = numbers.next()?;
            }
            layers.push(Layer { inputs, weights, bias });
        }
        (numbers.next().is_none() && rest.is_empty()).then_some(Network { layers })
    }

    /// The outputs for `features`, with [`REACH`] fewer cells on every side.
    pub(super) fn run(&self, features: &Cells) -> Cells {
        let [first, inner @ .., last] = self.layers.as_slice() else {
            unreachable!("a parsed network has all layers")
        };
        let mut state = rectified(first.apply(features));
        for [into, out_of] in inner.as_chunks::<2>().0 {
            let mut sum = out_of.apply(&rectified(into.apply(&state)));
            add_middle(&mut sum, &state);
            state = sum;
        }
        last.apply(&state)
    }
}

/// `cells` with negative numbers replaced by 0.
fn rectified(mut cells: Cells) -> Cells {
    cells.cells.as_flattened_mut().iter_mut().for_each(|v| *v = v.max(0.0));
    cells
}

/// Adds the middle of `other`, which has two cells more on every side.
fn add_middle(cells: &mut Cells, other: &Cells) {
    for (y, row) in cells.cells.chunks_exact_mut(cells.width).enumerate() {
        let from = &other.cells[(y + 2) * other.width + 2..][..row.len()];
        let to = row.as_flattened_mut().iter_mut();
        to.zip(from.as_flattened()).for_each(|(to, from)| *to += from);
    }
}

impl Layer {
    /// The convolution of `input`, one cell smaller on every side.
    fn apply(&self, input: &Cells) -> Cells {
        let mut output = Cells::new(input.width - 2, input.height - 2);
        assert!(output.width >= GROUP && self.inputs <= WIDTH, "tiles are wider");
        run_fastest(Convolution { layer: self, input, output: &mut output });
        output
    }
}

struct Convolution<'a> {
    layer: &'a Layer,
    input: &'a Cells,
    output: &'a mut Cells,
}

impl Kernel for Convolution<'_> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Convolution { layer, input, output } = self;
        let (width, inputs) = (output.width, layer.inputs);
        let bias: [[f32; 8]; VECTORS] = bytemuck::cast(layer.bias);
        let weights: &[[[f32; 8]; VECTORS]] = bytemuck::cast_slice(&layer.weights);
        for y in 0..output.height {
            let mut x = 0;
            loop {
                let mut sums = [bias; GROUP];
                for (place, weights) in weights.chunks_exact(inputs).enumerate() {
                    let from = (y + place / 3) * input.width + x + place % 3;
                    let cells = &input.cells[from..][..GROUP];
                    for (i, weights) in weights.iter().enumerate() {
                        for (sums, cell) in sums.iter_mut().zip(cells) {
                            let value = cell[i % WIDTH];
                            for (sums, weights) in sums.iter_mut().zip(weights) {
                                for (sum, weight) in sums.iter_mut().zip(weights) {
                                    *sum = multiply_add::<FUSED>(value, *weight, *sum);
                                }
                            }
                        }
                    }
                }
                let sums: [Cell; GROUP] = bytemuck::cast(sums);
                output.cells[y * width + x..][..GROUP].copy_from_slice(&sums);
                if x + GROUP == width {
                    break;
                }
                x = (x + GROUP).min(width - GROUP);
            }
        }
    }
}
