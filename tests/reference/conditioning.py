"""The publication's equations (1) and (2) and its rule for faulty sensors in numpy, from `docs/algorithm.md`.

This is the daemon's `[conditioning]` with `preset = "paper"`.
"""

import math

import numpy as np

# What the daemon's configuration has to say for this to be its reference.
DAEMON_SETTINGS = {"preset": "paper"}
PATIENCE_FRAMES = 10


def squared_magnitude(counts):
    """s_n = ||s_n||_2^2 of (N, 3) counts: up to 2^34, exact."""
    s = np.asarray(counts, dtype=np.int64)
    return np.sum(s * s, axis=1)


def faulty_sensors(counts, present=None):
    """f_n on s_0: any axis above the mean of the present sensors by more than their standard deviation; both from exact sums."""
    s = np.asarray(counts, dtype=np.int64)
    present = np.ones(len(s), dtype=bool) if present is None else present
    faulty = np.zeros(len(s), dtype=bool)
    for axis in s.T:
        values = [int(v) for v in axis[present]]
        n, total, squares = len(values), sum(values), sum(v * v for v in values)
        if n:
            mean, deviation = total / n, math.sqrt(n * squares - total * total) / n
            faulty |= (axis - mean > deviation) & present
    return faulty


class Conditioner:
    """Frames in, (force, contact, faulty) out; the first pair of frames, s_0 and s_1, calibrates it.

    A missing taxel has no force and no contact in that frame. Of one that is silent in s_0 nothing is said here: the daemon takes
    its baseline from other frames.
    """

    def __init__(self):
        self.waited = 0
        self.baseline = self.threshold = None

    def feed(self, counts, missing=None):
        missing = np.zeros(len(counts), dtype=bool) if missing is None else missing
        nothing = np.zeros(len(counts))
        magnitude = squared_magnitude(counts)
        if self.baseline is None:
            self.waited += 1
            self.faulty = nothing > 0
            if not np.any(missing) or self.waited == PATIENCE_FRAMES:
                self.faulty = faulty_sensors(counts, ~missing)
                self.present, self.baseline = ~missing, np.where(missing, 0, magnitude)
            return nothing, nothing > 0, self.faulty
        force = np.where(missing, 0, np.abs(magnitude - self.baseline)).astype(np.float64)  # (1)
        if self.threshold is None:
            self.threshold = force[self.present & ~self.faulty].max(initial=0.0)  # (2)
            return force, nothing > 0, self.faulty
        return force, (force > self.threshold) & ~self.faulty & ~missing, self.faulty
