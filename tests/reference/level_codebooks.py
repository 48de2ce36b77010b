"""Force levels that do not come from one frame: in steps, and learned while the program runs.

Written from `docs/algorithm.md`, "Number and place of levels" and "Levels learned while it runs", in Python's own
doubles; it shares nothing with the Rust.
"""

from math import frexp

from exact_levels import optimal_levels


def just_distinguishable(jnd, force_min, force_max):
    """K_D of the profile's `jnd`."""
    reached, k = force_min, 0
    while reached < force_max and k < 255:
        reached *= 1 + jnd
        k += 1
    return max(k, 1)


def equal_steps(k, m, big_m):
    return [m + ((i - 0.5) * (big_m - m)) / k for i in range(1, k + 1)]


def weber_steps(k, m, big_m):
    r = root(big_m / m, 2 * k)
    levels, p = [], m * r
    for _ in range(k):
        levels.append(min(p, big_m))
        p *= r * r
    return levels


def root(q, n):
    """The n-th root of q >= 1: the greatest double that halving finds whose power is not above q."""
    below, above = 1.0, 1.0 + (q - 1.0) / n
    while below < (middle := 0.5 * (below + above)) < above:
        if power(middle, n) <= q:
            below = middle
        else:
            above = middle
    return below


def power(x, n):
    product = 1.0
    while n:
        if n % 2:
            product *= x
        x *= x
        n //= 2
    return product


def nearest(rho, levels):
    """The level, 1..K, nearest to a force; of several the first."""
    return 1 + min(range(len(levels)), key=lambda k: (rho - levels[k]) * (rho - levels[k]))


def nearest_in_ratio(rho, levels):
    """The first level whose border with the next is not below the force."""
    borders = (a * b for a, b in zip(levels, levels[1:]))
    return 1 + next((k for k, border in enumerate(borders) if rho * rho <= border), len(levels) - 1)


def lifted(forces, numbers, k):
    """**top**: the contacts of the strongest one's level have the highest, K."""
    strongest = max(zip(forces, numbers), default=(0.0, k))[1]
    return [k if n == strongest else n for n in numbers]


class Learned:
    """Levels learned while the program runs. A force's bin is its octave and which sixteenth of that it lies in."""

    def __init__(self, levels, forgetting):
        self.most, self.keep = levels, 1.0 - forgetting
        self.bins = {}

    def learn(self, forces):
        """Takes the forces of a frame's contacts, in the order of the list."""
        if not forces:
            return
        self.bins = {b: (w * self.keep, s * self.keep) for b, (w, s) in self.bins.items() if w * self.keep >= 1e-200}
        for rho in forces:
            mantissa, exponent = frexp(rho)
            b = (exponent, int(32 * mantissa))
            w, s = self.bins.get(b, (0.0, 0.0))
            self.bins[b] = (w + 1.0, s + rho)

    def weighted(self):
        """The values and their weights that levels are fitted to."""
        total = 0.0
        for _, (w, _) in sorted(self.bins.items()):
            total += w
        unit = min(1024.0, 2.0**30 / total)
        values, weights = [], []
        for _, (w, s) in sorted(self.bins.items()):
            if int(w * unit) > 0 and not (values and s / w <= values[-1]):
                values.append(s / w)
                weights.append(int(w * unit))
        return values, weights

    def levels(self):
        """Every list of levels with the least error: mostly one."""
        values, weights = self.weighted()
        return [levels for levels, _ in optimal_levels(values, self.most, weights)]
