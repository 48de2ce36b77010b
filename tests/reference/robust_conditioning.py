"""The daemon's own conditioning in numpy: a baseline and a threshold that are measured, faults that stand out.

What the publication's section IV-B becomes when a hand has offsets that are far apart, taxels that are dead, and
noise (`conditioning.py` has the publication's). The repair of single samples is left out: `SETTINGS` switch it off.
Times are in nanoseconds. Medians of an even number of counts are the mean of the middle two; those of a hand's taxels are
the upper one.
"""

import math

import numpy as np

# What the daemon's configuration has to say for this to be its reference.
SETTINGS = {"calibration_ms": 300, "repair_wraps": False, "reject_glitches": False}

MS = 1_000_000
NEVER = 1 << 32
SIGMAS_PER_MAD = 1.4826
WINDOW_NS, LEAST_FRAMES = 300 * MS, 10
OUTLIER_SIGMAS = 5.0
STEPS, STEP_REVERSALS, STEP_WITNESSES = range(4, 1025), 4, 2
STEP_ON_ALL_AXES = 1.75
MOVED_PEAKS, MOVED_LEAST, MOVED_SAMPLES, SLOW_VARIANCES = 2.0, 4, 16, 3.0
WANDER_VARIANCES, WANDER_COUNTS = 12.0, 20.0
NOISE_SAMPLES, NOISE_PARTS, NOISIER_VARIANCES, NOISIER_PEAKS, NOISE_OFF_LEVEL = 10, 4, 2.0, 1.25, 0.6
NOISIER_ONE_OF = 4
TOUCH_COUNTS, TOUCH_SIGMAS = 60.0, 4.0
NOISE_SIGMAS, NOISE_FLOOR = 8.0, 150.0
MARGIN, RELEASE, LEAST_THRESHOLD = 1.5, 0.8, 10.0
DRIFT_WAIT_NS, DRIFT_TIME_CONSTANT_MS, DRIFT_QUIET, DRIFT_LIMIT = 1000 * MS, 30_000, 0.5, 1000.0
JUDGING_NS = 50 * MS
DEAD_SAMPLES = 3


def magnitude(counts, baseline):
    """Distance of (..., 3) counts from the baseline."""
    d = np.asarray(counts, dtype=np.float64) - baseline
    x, y, z = d[..., 0], d[..., 1], d[..., 2]
    return np.sqrt(x * x + y * y + z * z)


def upper_spread(values):
    """Upper median and 1.4826 times the upper median of the distances from it; zeros of nothing."""
    if len(values) == 0:
        return 0.0, 0.0
    middle = len(values) // 2
    centre = np.sort(values)[middle]
    return centre, SIGMAS_PER_MAD * np.sort(np.abs(values - centre))[middle]


def steps_of(samples):
    """The steps (N, 3) that the counts of (T, N, 3) samples go in; 1 where none is found.

    An axis that changes at least four times against its change before shows its least change as a step. A step is found that two axes of the hand
    show, or one where there are fewer than three taxels; those that change in the same samples, by the sum of their numbers
    modulo 64, count once, and one that is shorter by one is the same, rounded. An axis has the longest one that is no longer
    than its least change and one.
    """
    signed = np.diff(np.asarray(samples, dtype=np.int64), axis=0)
    changes = np.abs(signed)
    least = np.where(changes > 0, changes, NEVER).min(axis=0, initial=NEVER)
    times = np.einsum("t,tna->na", np.arange(1, len(samples)), changes > 0) % 64
    reversals = np.empty(least.shape, dtype=np.int64)
    for axis in np.ndindex(least.shape):
        changed = signed[(slice(None), *axis)]
        reversals[axis] = np.count_nonzero(np.diff(np.sign(changed[changed != 0])))
    shows = (reversals >= STEP_REVERSALS) & np.isin(least, STEPS)
    shown = set(zip(least[shows], times[shows]))
    witnesses = 1 if len(least) < 3 else STEP_WITNESSES
    steps = np.ones_like(least)
    for step in sorted({step for step, _ in shown}):
        if len({time for s, time in shown if s in (step, step - 1)}) >= witnesses:
            steps[(least < NEVER) & (least >= step - 1)] = step
    return steps


def usual(samples, step):
    """Which of (T, 3) samples are no outliers, their mean, and the largest magnitude above it."""
    centre = np.median(samples, axis=0)
    sigma = SIGMAS_PER_MAD * np.median(np.abs(samples - centre), axis=0)
    kept = np.all(np.abs(samples - centre) <= OUTLIER_SIGMAS * np.maximum(sigma, np.asarray(step) / 2.0), axis=1)
    baseline = samples[kept].sum(axis=0) / np.sum(kept) if np.any(kept) else centre
    return kept, baseline, float(magnitude(samples[kept], baseline).max(initial=0.0))


def successive_variance(samples, kept):
    """Variance of each axis of (T, 3) samples from one to the next, so that slow motion is none; an outlier interrupts."""
    steps = np.diff(samples, axis=0)[kept[1:] & kept[:-1]]
    return np.sum(steps * steps / 2.0, axis=0) / max(1, len(steps))


def wanders(variance, noise, step):
    """Whether samples of this variance, and of so much from one to the next, vary far more slowly than noise, and by more than
    a step."""
    least = max(WANDER_COUNTS, float(np.max(step)))
    return bool(variance > least * least and variance > WANDER_VARIANCES * noise)


def judge_movement(rest):
    """Where most taxels move in one half of the window: takes the other one, and says so. Of fewer than half of them, those
    that wander have their baseline from it, if it is still."""
    for moved in range(2):
        moving = [r.moves(moved) for r in rest]
        if 2 * sum(moving) > len(rest):
            for r, moves in zip(rest, moving):
                r.touched |= moves
                if r.halves:
                    still = r.halves[1 - moved]
                    r.baseline, r.peak, r.noise_peak = still.baseline, still.peak, min(r.noise_peak, still.noise_peak)
            return True
    if 2 * sum(r.wanders for r in rest) <= len(rest):
        for r in rest:
            still = next((r.halves[1 - moved] for moved in range(2) if r.wanders and r.moves(moved)), None)
            if still is not None and not still.wanders:
                r.baseline = still.baseline
    return False


def variances(samples, step):
    """Of (T, 3) samples, outliers left out: variance, the one from sample to sample, their mean, and how far they go. Both
    variances are of the same samples, those with a neighbour that is no outlier either."""
    kept, mean, peak = usual(samples, step)
    pairs = kept[1:] & kept[:-1]
    both = np.concatenate([samples[:-1][pairs], samples[1:][pairs]])
    variance = np.sum((both - np.mean(both, axis=0)) ** 2) / len(both) if len(both) else 0.0
    return variance, np.sum(successive_variance(samples, kept)), mean, peak


class Half:
    """What half a window of (T, 3) samples says; `noise`, `level` and `peak` are those of the whole window."""

    def __init__(self, samples, step, noise, level, peak):
        variance, own_noise, self.baseline, self.peak = variances(samples, step)
        self.is_slow = bool(variance > SLOW_VARIANCES * own_noise)
        self.wanders = wanders(variance, own_noise, step)
        self.noise_peak = 0.0
        n = len(samples)
        parts = min(max(n // NOISE_SAMPLES, 1), NOISE_PARTS)
        for part in range(parts):
            of = samples[part * n // parts : (part + 1) * n // parts]
            part_variance, part_noise, part_level, part_peak = variances(of, step)
            noisier = part_noise > NOISIER_VARIANCES * noise and part_peak > NOISIER_PEAKS * peak
            stays = np.sum((part_level - level) ** 2) <= NOISE_OFF_LEVEL**2 * part_variance
            if noisier and stays and part_variance <= SLOW_VARIANCES * part_noise:
                self.noise_peak = max(self.noise_peak, part_peak)


class Rest:
    """What a taxel's (T, 3) samples at rest say of it; `step` is that of the counts, or of each axis."""

    def __init__(self, samples, step=1):
        samples = np.asarray(samples, dtype=np.float64)
        kept, self.baseline, self.peak = usual(samples, step)
        total, noise, _, _ = variances(samples, step)
        self.wanders = wanders(total, noise, step)
        self.step = int(np.max(step))
        self.constant = bool(np.all(samples == samples[0]))
        variance = successive_variance(samples, kept)
        self.noise = math.sqrt(variance[0] + variance[1] + variance[2])
        n = len(samples)
        halves = (samples[: n // 2], samples[n // 2 :]) if n >= MOVED_SAMPLES else ()
        self.halves = [Half(half, step, noise, self.baseline, self.peak) for half in halves]
        quarters = [np.median(samples[q * n // 4 : (q + 1) * n // 4], axis=0) for q in range(4 if n >= 8 else 1)]
        shift = np.max(quarters, axis=0) - np.min(quarters, axis=0)
        self.touched = bool(np.any(shift > np.maximum(TOUCH_COUNTS, TOUCH_SIGMAS * np.sqrt(variance))))
        # Under a touch, what presses trembles. Loud noise takes the level of a quarter as far, as outliers.
        raw = successive_variance(samples, np.ones(n, dtype=bool))
        pressed = np.any(shift > np.maximum(TOUCH_COUNTS, TOUCH_SIGMAS * np.sqrt(raw)))
        self.noise_peak = 0.0 if pressed else max((half.noise_peak for half in self.halves), default=0.0)

    def moves(self, half):
        """Whether the taxel moves in this half of the window, and not in the other."""
        if not self.halves:
            return False
        still = max(self.halves[1 - half].peak, self.step, MOVED_LEAST)
        return self.halves[half].is_slow and self.halves[half].peak > MOVED_PEAKS * still


class RobustConditioner:
    """Complete frames in, (force, contact, faulty) out; None while it calibrates."""

    def __init__(self, taxels):
        self.frames = []
        self.calibrated = False
        self.judged = None  # how many taxels, once the window is over
        self.contact = np.zeros(taxels, dtype=bool)
        self.dead_run = np.zeros(taxels, dtype=int)

    def feed(self, counts, t_ns, frame_ns):
        """counts: (N, 3); t_ns: (N,) when each was measured; frame_ns: when the frame was complete."""
        counts, t_ns = np.asarray(counts, dtype=np.int64), np.asarray(t_ns, dtype=np.int64)
        self.dead_run = np.where(np.all((counts == 0) | (counts == 65535), axis=1), self.dead_run + 1, 0)
        if self.judged is not None:
            self.stuck &= np.all(counts == self.rested_at, axis=1)
        felt = self.feel(counts, t_ns) if self.calibrated else None
        if self.judged is not None and not self.calibrated:
            # Judging is spread over the frames of 50 ms.
            self.judged += max(4, math.ceil(len(counts) * min(1.0, (frame_ns - self.last_ns) / JUDGING_NS)))
            self.calibrated = self.judged >= len(counts)
        elif self.judged is None:
            self.frames.append((counts, frame_ns))
            if len(self.frames) >= LEAST_FRAMES and frame_ns - self.frames[0][1] >= WINDOW_NS:
                self.calibrate()
                self.judged = 0
        self.last_ns = frame_ns
        self.last_t_ns = t_ns
        return felt

    def calibrate(self):
        samples = np.stack([counts for counts, _ in self.frames])
        assert len(samples) <= 128, "longer windows are thinned out"
        taxels = samples.shape[1]
        alive = ~np.all((samples == 0) | (samples == 65535), axis=(0, 2))
        rest = [Rest(samples[:, n], step) for n, step in enumerate(steps_of(samples))]
        # What did not change is stuck until it does, and has its baseline from then on like any other.
        self.stuck = alive & np.array([r.constant for r in rest])
        usable = alive & ~self.stuck
        noise = np.array([r.noise for r in rest])
        median, sigma = upper_spread(noise[usable])
        # Noise on the edge of a step is as large as the step.
        floor = max([NOISE_FLOOR, *(STEP_ON_ALL_AXES * r.step for r, u in zip(rest, usable) if u)])
        noisy = noise > max(median + NOISE_SIGMAS * sigma, floor)
        # There is no way back from these here: the tests' frames have none.
        self.faulty = ~alive | noisy
        # Most taxels of a skin without noise keep one value at rest; in a hand with noise those that do are dead, and few.
        keeps_still = 2 * np.sum(self.stuck) > np.sum(alive)
        moved = judge_movement([r for r, u in zip(rest, alive if keeps_still else usable) if u])
        self.baseline = np.array([r.baseline for r in rest])
        self.rested_at = self.baseline.copy()
        # What wanders on a skin that keeps still is a touch, and not how the skin rests.
        touch = np.array([keeps_still and r.wanders for r in rest])
        healthy = usable & ~noisy & ~touch
        untouched = healthy & ~np.array([r.touched for r in rest])
        peaks = np.array([r.peak for r in rest])
        noise_peaks = np.array([r.noise_peak for r in rest])
        if NOISIER_ONE_OF * np.sum(noise_peaks[usable] > 0) > np.sum(usable):
            peaks = np.maximum(peaks, noise_peaks)
        peaks = peaks[untouched if np.any(untouched) and not moved else healthy]
        median, sigma = upper_spread(peaks)
        # One step up and down is no stray.
        step = STEP_ON_ALL_AXES * max((r.step for r, h in zip(rest, healthy) if h), default=1)
        theta = min(peaks.max(initial=0.0), max(median + NOISE_SIGMAS * max(sigma, median / 4.0), step))
        self.threshold = max(theta * MARGIN, LEAST_THRESHOLD)
        self.quiet_since = np.full(taxels, -1, dtype=np.int64)
        self.level = np.zeros(taxels)

    def feel(self, counts, t_ns):
        faulty = self.faulty | self.stuck | (self.dead_run >= DEAD_SAMPLES)
        force = np.where(faulty, 0.0, magnitude(counts, self.baseline))
        self.contact = ~faulty & (force > np.where(self.contact, self.threshold * RELEASE, self.threshold))
        self.follow(counts, force, t_ns, ~faulty & ~self.contact)
        return force, self.contact, faulty

    def follow(self, counts, force, t_ns, quiet):
        """The baseline follows slow drift of taxels that are untouched for long."""
        dt = (t_ns - self.last_t_ns).astype(np.float64)
        begins = quiet & (self.quiet_since < 0)
        smoothed = self.level + (force - self.level) * np.minimum(dt * (1e-6 / (DRIFT_WAIT_NS // MS)), 1.0)
        self.level = np.where(begins, force, np.where(quiet, smoothed, self.level))
        self.quiet_since = np.where(quiet, np.where(begins, t_ns, self.quiet_since), -1)
        waited = quiet & (t_ns - self.quiet_since >= DRIFT_WAIT_NS)
        moves = waited & (self.level < DRIFT_QUIET * self.threshold)
        share = np.minimum(dt * (1e-6 / DRIFT_TIME_CONSTANT_MS), 1.0)[:, None]
        moved = self.baseline + (counts - self.baseline) * share
        assert np.all(np.abs(moved - self.rested_at) <= DRIFT_LIMIT), "the tests' frames do not drift that far"
        self.baseline = np.where(moves[:, None], moved, self.baseline)
