"""Force levels with the least error there is, by brute force in exact integers.

The force stage of the method `optimal` (`docs/algorithm.md`): every way to cut the sorted forces into K intervals is
weighed by dynamic programming, in whole numbers of any length, so nothing is rounded. It takes K n^2 steps and shares
nothing with the Rust, which never looks at most of the intervals.
"""

from fractions import Fraction
from itertools import islice
from math import lcm

import numpy as np

MANY = 10_000  # partitions of equal error that are looked through


class Forces:
    """The forces of one frame's contacts, as whole numbers on a common grid; with weights, whole numbers, each counts so often."""

    def __init__(self, forces, weights=None):
        forces = np.asarray(forces, dtype=np.float64)
        order = np.argsort(forces, kind="stable")
        self.forces = forces[order]
        self.weights = np.ones(len(forces), dtype=int) if weights is None else np.asarray(weights)[order]
        exact = [Fraction(f) for f in self.forces]
        self.grid = lcm(*(f.denominator for f in exact))
        steps = [int(f * self.grid) for f in exact]
        # Where a new value begins: equal forces stay together.
        self.cuts = [i for i in range(len(steps)) if i == 0 or steps[i] != steps[i - 1]] + [len(steps)]
        # Errors as multiples of 1 / (grid^2 * common), which all are. With weights that would be far too small a number,
        # and they are fractions.
        self.common = lcm(*range(1, len(steps) + 1)) if weights is None else None
        counts, sums, squares = [0], [0], [0]
        for s, w in zip(steps, self.weights.tolist()):
            counts.append(counts[-1] + w)
            sums.append(sums[-1] + w * s)
            squares.append(squares[-1] + w * s * s)
        self.error_of = [
            [self._error(counts, sums, squares, i, j) if i < j else 0 for j in self.cuts] for i in self.cuts
        ]

    def _error(self, counts, sums, squares, begin, end):
        n, s = counts[end] - counts[begin], sums[end] - sums[begin]
        error = n * (squares[end] - squares[begin]) - s * s
        return Fraction(error, n) if self.common is None else error * (self.common // n)

    def least_errors(self, most):
        """best[k][j]: the least error of the first j different values in k clusters; k up to `most` or their number."""
        values = len(self.cuts) - 1
        best = [[0] + [None] * values]
        for k in range(1, min(most, values) + 1):
            row = [None] * (values + 1)
            for j in range(k, values + 1):
                row[j] = min(
                    before + self.error_of[i][j]
                    for i, before in enumerate(best[-1][:j])
                    if before is not None
                )
            best.append(row)
        return best

    def partitions(self, most):
        """Every partition with the least error, as the borders between the sorted forces."""
        best = self.least_errors(most)

        def back(k, j):
            if k == 0:
                yield ()
                return
            for i in range(k - 1, j):
                before = best[k - 1][i]
                if before is not None and before + self.error_of[i][j] == best[k][j]:
                    for head in back(k - 1, i):
                        yield (*head, self.cuts[i])

        return back(len(best) - 1, len(self.cuts) - 1)

    def levels(self, partition):
        """The force of each level: `first + (sum of w (rho - first)) / (sum of w)`, summed in ascending order."""
        ends = (*partition[1:], len(self.forces))
        levels = []
        for begin, end in zip(partition, ends):
            rho, w = self.forces[begin:end], self.weights[begin:end]
            levels.append(float(rho[0] + np.cumsum(w * (rho - rho[0]))[-1] / np.sum(w)))
        return levels

    def numbers(self, partition, forces):
        """The level, 1..K, of each of these forces."""
        return np.searchsorted(self.forces[list(partition)], forces, side="right")


def optimal_levels(forces, most, weights=None):
    """Every list of levels that has the least error, with its partition: mostly one. Not all of them where there are very many."""
    of = Forces(forces, weights)
    return [(of.levels(p), of.numbers(p, np.asarray(forces))) for p in islice(of.partitions(most), MANY)]
