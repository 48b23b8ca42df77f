"""The network: 2x2 Haar coefficients of opponent colours, gated and shifted in units of noise.

A picture is linear light, shape (batch, height, width, 3), 0..255, even sides; noise is the
standard deviation of each channel, grey levels, shape (batch, height / 2, width / 2, 3).
"""

import numpy as np
import tensorflow as tf

LAYERS = 8  # convolutions: one in, three residual pairs, one out
REACH = LAYERS  # cells that valid convolutions take off each side
PAIRS = 3
PLANES = 12
OPPONENT = np.array(
    [
        np.array([1, 1, 1]) / np.sqrt(3),
        np.array([1, 0, -1]) / np.sqrt(2),
        np.array([1, -2, 1]) / np.sqrt(6),
    ],
    np.float32,
)


def coefficients(picture):
    """Haar coefficients (batch, h, w, 3 colours Y U V, 4 bands a h v d) of a picture."""
    colours = tf.einsum("bijc,kc->bijk", picture, OPPONENT)
    p00, p01 = colours[:, ::2, ::2], colours[:, ::2, 1::2]
    p10, p11 = colours[:, 1::2, ::2], colours[:, 1::2, 1::2]
    bands = [
        p00 + p01 + p10 + p11,
        p00 - p01 + p10 - p11,
        p00 + p01 - p10 - p11,
        p00 - p01 - p10 + p11,
    ]
    return tf.stack(bands, -1) / 2


def picture_of(values):
    """Picture of Haar coefficients: the inverse of `coefficients`."""
    a, h, v, d = tf.unstack(values, axis=-1)
    rows = [
        tf.stack([a + h + v + d, a - h + v - d], 3),
        tf.stack([a + h - v - d, a - h - v + d], 3),
    ]
    shape = tf.shape(a)
    colours = tf.stack(rows, 2) / 2  # batch, h, 2, w, 2, colour
    colours = tf.reshape(colours, (shape[0], 2 * shape[1], 2 * shape[2], 3))
    return tf.einsum("bijk,kc->bijc", colours, OPPONENT)


def local_mean(plane):
    """Mean over 3x3 cells, borders repeated."""
    padded = tf.pad(plane, [[0, 0], [1, 1], [1, 1], [0, 0]], "SYMMETRIC")
    return tf.nn.avg_pool2d(padded, 3, 1, "VALID")


def opponent_noise(noise):
    """Noise of Y, U, V of the noise of R, G, B."""
    return tf.sqrt(tf.einsum("bijc,kc->bijk", noise * noise, OPPONENT * OPPONENT))


def features(values, means, noise):
    """The 18 features: 12 bands by colour, 3 local means, 3 noise levels."""
    scaled = (values - with_zeros(means)) / noise[..., None]
    bands = tf.reshape(asinh(scaled), tf.concat([tf.shape(means)[:3], [PLANES]], 0))
    return tf.concat([bands, 0.25 * asinh(means / noise), 0.25 * tf.math.log(noise)], -1)


def asinh(x):
    """Inverse hyperbolic sine, to some 1e-7; faster than TensorFlow's own."""
    size = tf.abs(x)
    return tf.sign(x) * tf.math.log(size + tf.sqrt(size * size + 1))


def with_zeros(means):
    """Local means as the band `a`, zero in the other bands."""
    zero = tf.zeros_like(means)
    return tf.stack([means, zero, zero, zero], -1)


def crop(planes, cells):
    """Planes without `cells` at each side."""
    return planes[:, cells:-cells, cells:-cells] if cells else planes


def new_weights(width, seed):
    """Weights (kernel, bias) of each layer, kernels of shape (3, 3, in, out)."""
    random = np.random.default_rng(seed)
    channels = [18] + [width] * (LAYERS - 1) + [2 * PLANES]
    weights = []
    for layer in range(LAYERS):
        scale = np.sqrt(2 / (9 * channels[layer]))
        if layer in (2, 4, 6, 7):  # ends of residual pairs and the last layer start near zero
            scale *= 0.2
        kernel = random.normal(0, scale, (3, 3, channels[layer], channels[layer + 1]))
        weights.append(tf.Variable(kernel.astype(np.float32)))
        weights.append(tf.Variable(np.zeros(channels[layer + 1], np.float32)))
    return weights


def outputs(weights, planes):
    """The 24 outputs of the convolutions, `REACH` cells smaller at each side."""

    def convolve(x, layer):
        return tf.nn.conv2d(x, weights[2 * layer], 1, "VALID") + weights[2 * layer + 1]

    x = tf.nn.relu(convolve(planes, 0))
    for pair in range(PAIRS):
        inner = tf.nn.relu(convolve(x, 1 + 2 * pair))
        x = crop(x, 2) + convolve(inner, 2 + 2 * pair)
    return convolve(x, LAYERS - 1)


def denoise(weights, picture, noise):
    """Denoised picture, 2 * `REACH` pixels smaller at each side."""
    values = coefficients(picture)
    means, levels = local_mean(values[..., 0]), opponent_noise(noise)
    out = outputs(weights, features(values, means, levels))
    values, means, levels = (crop(planes, REACH) for planes in (values, means, levels))
    shape = tf.shape(values)
    gates = tf.reshape(tf.sigmoid(out[..., :PLANES]), shape)
    additions = tf.reshape(out[..., PLANES:], shape)
    offsets = with_zeros(means)
    return picture_of(gates * (values - offsets) + levels[..., None] * additions + offsets)


def denoise_whole(weights, picture, noise):
    """Denoised picture of full size: padded by reflection (edge not repeated), then cropped."""
    border = [[0, 0], [2 * REACH] * 2, [2 * REACH] * 2, [0, 0]]
    cells = [[0, 0], [REACH] * 2, [REACH] * 2, [0, 0]]
    padded = tf.constant(np.pad(np.asarray(picture, np.float32), border, "reflect"))
    return denoise(
        weights, padded, tf.constant(np.pad(np.asarray(noise, np.float32), cells, "edge"))
    )
