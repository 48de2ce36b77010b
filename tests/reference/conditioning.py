"""The publication's section IV-B in numpy: baseline, contact threshold, faulty sensors, from the first two frames.

This is the daemon's `[conditioning]` with every setting as the publication has it: `magnitude =
"literal_squared"`, baseline from frame 0, threshold from frame 1, faults by mean plus one standard deviation.
"""

import numpy as np

# What the daemon's configuration has to say for this to be its reference.
DAEMON_SETTINGS = {
    "baseline": "first_frame",
    "magnitude": "literal_squared",
    "threshold": "first_pair",
    "threshold_margin": 1.0,
    "threshold_release": 1.0,
    "threshold_min_counts": 0.0,
    "fault_rule": "paper",
    "repair_wraps": False,
    "reject_glitches": False,
    "follow_drift": False,
}


def squared_magnitude(counts):
    """s_n = ||s_n||_2^2 of (N, 3) counts: up to 2^34, exact."""
    s = np.asarray(counts, dtype=np.int64)
    return np.sum(s * s, axis=1)


def faulty_sensors(counts, present=None):
    """f_n on frame 0: any axis above the mean of the present sensors by more than their standard deviation."""
    s = np.asarray(counts, dtype=np.float64)
    present = np.ones(len(s), dtype=bool) if present is None else present
    mean, deviation = s[present].mean(axis=0), s[present].std(axis=0)
    return np.any(s > mean + deviation, axis=1) & present


class Conditioner:
    """Frames in, (force, contact, faulty) out; the first two frames calibrate it.

    A missing taxel has no force and no contact in that frame. Calibration frames have to be complete.
    """

    def __init__(self):
        self.frames = 0

    def feed(self, counts, missing=None):
        missing = np.zeros(len(counts), dtype=bool) if missing is None else missing
        magnitude = squared_magnitude(counts)
        if self.frames == 0:
            self.faulty = faulty_sensors(counts)
            self.baseline = magnitude
        force = np.where(missing, 0.0, np.abs(magnitude - self.baseline))  # (1)
        if self.frames == 1:
            self.threshold = force[~self.faulty].max(initial=0.0)  # (2)
        if self.frames < 2:
            contact = np.zeros(len(force), dtype=bool)
        else:
            contact = (force > self.threshold) & ~self.faulty & ~missing
        self.frames += 1
        return force, contact, self.faulty
