"""Hands at rest and being touched, as counts; small, and without the daemon's simulator."""

import numpy as np

REST = np.array([32750, 32700, 12800])  # idle x, y, z of uSkin (protocols 2.6)


class Touches:
    """A hand whose taxels sit at (N, 3) `rest` counts; every frame is made from it."""

    def __init__(self, hand, rest):
        self.hand = hand
        self.at_rest = np.asarray(rest, dtype=np.int64)

    @classmethod
    def even(cls, hand):
        """Every taxel alike, so that the publication's fault rule finds nothing."""
        return cls(hand, np.tile(REST, (len(hand), 1)))

    @classmethod
    def uneven(cls, hand, seed, dead=()):
        """Offsets as far apart as those of real modules; dead taxels read 65535."""
        random = np.random.default_rng(seed)
        rest = REST + random.normal(0, [60, 90, 400], (len(hand), 3)).round().astype(int)
        rest[list(dead)] = 65535
        return cls(hand, rest)

    def frame(self, press=None):
        """Counts with `press`, (N,) or (N, 3), added where the taxel lives."""
        counts = self.at_rest.copy()
        if press is not None:
            press = np.asarray(press)
            change = press if press.ndim == 2 else np.column_stack([press // 8, -(press // 5), press])
            alive = ~np.all(counts == 65535, axis=1)
            counts[alive] += change[alive].astype(np.int64)
        return np.clip(counts, 0, 65535)

    def breath(self):
        """The second frame: three counts of noise on a few taxels set the threshold."""
        noise = np.zeros((len(self.hand), 3), dtype=int)
        noise[::7, 2] = 3
        return self.frame(noise)

    def resting(self, frames, seed):
        """Frames at rest with the noise of a live skin, which a calibration expects."""
        random = np.random.default_rng(seed)
        for _ in range(frames):
            yield self.frame(random.normal(0, [2, 4, 12], (len(self.hand), 3)).round().astype(int))

    def dome(self, x, y, radius, force):
        """A sphere's contact: `force` at (x, y), falling to nothing at `radius` pixels."""
        distance = np.hypot(self.hand.xy[:, 0] - x, self.hand.xy[:, 1] - y)
        return np.round(force * np.clip(1 - (distance / radius) ** 2, 0, None)).astype(int)


def grasp(touches):
    """A ball comes to four fingers, is squeezed, and slips: 0 to every contact. Starts with two frames at rest."""
    yield touches.frame()
    yield touches.breath()
    for step in range(1, 13):
        press = sum(touches.dome(x, 2 + 0.3 * step, 0.4 + 0.25 * step, 150 * step) for x in (1.5, 5.5, 9.5, 13.5))
        yield touches.frame(press)
    yield touches.frame()


def edges(touches):
    """Frames on which the flow chart says nothing."""
    n = len(touches.hand)
    yield touches.frame()
    yield touches.breath()
    one = np.zeros(n, dtype=int)
    one[100] = 500
    yield touches.frame(one)  # one contact: fewer than levels, fewer than actuators
    yield touches.frame(np.full(n, 900))  # every taxel, all alike
    yield touches.frame(np.arange(n) * 40)  # every taxel, all different
    sixteen = np.zeros(n, dtype=int)
    sixteen[:16] = np.arange(1, 17) * 111
    yield touches.frame(sixteen)  # as many contacts as actuators
    sixteen[16] = 2000
    yield touches.frame(sixteen)  # one more
    yield np.full((n, 3), 65535)  # everything at its end
    yield np.zeros((n, 3), dtype=int)
