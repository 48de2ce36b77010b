"""The networks' layers once more, in numpy, from the documentation of Keras 2 alone.

Prints the numbers that src/tests.rs expects: python crates/networks/tests/keras.py
"""

import numpy as np


def weights(*shape, scale, phase):
    """Weights that need no generator of random numbers."""
    return (scale * np.sin(np.arange(np.prod(shape)) + phase)).reshape(shape)


def sigmoid(x):
    return 1 / (1 + np.exp(-x))


def hard_sigmoid(x):
    return np.clip(0.2 * x + 0.5, 0, 1)


def same(images, kernel):
    """Convolution of (count, rows, columns, channels) with (rows, columns, channels, outputs), padding "same"."""
    count, rows, columns, _ = images.shape
    high, wide, _, outputs = kernel.shape
    above, left = (high - 1) // 2, (wide - 1) // 2
    padded = np.pad(images, [(0, 0), (above, high - 1 - above), (left, wide - 1 - left), (0, 0)])
    out = np.zeros((count, rows, columns, outputs))
    for y in range(rows):
        for x in range(columns):
            out[:, y, x] = np.tensordot(padded[:, y : y + high, x : x + wide], kernel, 3)
    return out


def recurrent(images, kernel, recurrent_kernel, bias, gate):
    """Outputs of a layer for (steps, count, rows, columns, channels), step by step."""
    units = bias.size // 4
    h = c = np.zeros(images.shape[1:-1] + (units,))
    outputs = []
    for image in images:
        z = same(image, kernel) + same(h, recurrent_kernel) + bias
        i, f, new, o = np.split(z, 4, -1)
        c = gate(f) * c + gate(i) * np.tanh(new)
        h = gate(o) * np.tanh(c)
        outputs.append(h)
    return np.array(outputs)


def show(name, values):
    print(name, ", ".join(f"{v:.6f}" for v in np.ravel(values)))


# Two LSTMs and a dense neuron: 4 steps, 2 examples, 3 values.
x = weights(4, 2, 1, 1, 3, scale=1.0, phase=0.0)
h = recurrent(x, weights(1, 1, 3, 20, scale=0.6, phase=1), weights(1, 1, 5, 20, scale=0.4, phase=2), weights(20, scale=0.5, phase=3), sigmoid)
h = recurrent(h, weights(1, 1, 5, 8, scale=0.6, phase=1), weights(1, 1, 2, 8, scale=0.4, phase=2), weights(8, scale=0.5, phase=3), sigmoid)
show("lstm", h[-1, :, 0, 0] @ weights(2, 1, scale=0.6, phase=1) + weights(1, scale=0.5, phase=3))

# A ConvLSTM of 3 x 2, a convolution of 2 x 2 and a dense neuron: 3 steps, 2 examples, 4 x 3 pixels.
x = weights(3, 2, 4, 3, 1, scale=1.0, phase=0.0)
h = recurrent(x, weights(3, 2, 1, 8, scale=0.6, phase=1), weights(3, 2, 2, 8, scale=0.4, phase=2), weights(8, scale=0.5, phase=3), hard_sigmoid)
h = np.maximum(same(h[-1], weights(2, 2, 2, 3, scale=0.6, phase=1)) + weights(3, scale=0.5, phase=3), 0)
show("conv_lstm", h.reshape(2, -1) @ weights(36, 1, scale=0.6, phase=1) + weights(1, scale=0.5, phase=3))

# Adam, three steps against gradients 1, -2 and 0.5 from 0.3 on.
p, m, v = 0.3, 0.0, 0.0
for t, g in enumerate([1.0, -2.0, 0.5], 1):
    m, v = 0.9 * m + 0.1 * g, 0.999 * v + 0.001 * g * g
    p -= 0.01 * np.sqrt(1 - 0.999**t) / (1 - 0.9**t) * m / (np.sqrt(v) + 1e-7)
show("adam", p)
