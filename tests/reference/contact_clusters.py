"""Clusters of weighted contacts around centroids, in numpy: what the actuators that follow contacts are made of.

From `docs/algorithm.md`, "Actuators: `follow`": the rounds of an assignment and of single contacts that move. Places are single
precision, sums double, in the order of the contact list; `np.cumsum` and `np.bincount` add in order.
"""

import numpy as np

F = np.float32
NOWHERE = F(1e17)  # where one is that was never anywhere
ROUNDS, FALLS = 6, 16.0


def in_order(terms):
    """A sum from the first term to the last."""
    return float(np.cumsum(np.asarray(terms, dtype=np.float64))[-1]) if len(terms) else 0.0


def squared(a, b):
    """Squared distance of two places in single precision."""
    dx, dy = F(a[0]) - F(b[0]), F(a[1]) - F(b[1])
    return dx * dx + dy * dy


class Clusters:
    """`k` clusters of the contacts `xy`, (N, 2), of `weight` and `height`: centroids `at` and `tall`, and whose each contact is."""

    def __init__(self, k):
        self.k = k
        self.id_bits = np.uint32((1 << (k - 1).bit_length()) - 1)
        self.at = np.full((k, 2), NOWHERE, dtype=F)
        self.tall = np.zeros(k, dtype=F)  # mean height of each one's contacts
        self.label = np.zeros(0, dtype=int)
        self.done = False  # the last rounds left nothing to do

    def take(self, xy, weight):
        """Contacts of a frame. Without weights, all weigh alike."""
        self.xy = np.asarray(xy, dtype=F).reshape(-1, 2)
        self.weighted = weight is not None
        self.weight = np.ones(len(xy)) if weight is None else np.asarray(weight, dtype=F).astype(np.float64)

    def raise_contacts(self, height):
        self.raised = height is not None
        self.height = np.asarray(height, dtype=F) if self.raised else np.zeros(len(self.xy), dtype=F)

    def assign(self):
        """To the nearest centroids; the lowest bits of a distance say whose it is. Returns how many labels changed."""
        d, dz = self.xy[:, None, :] - self.at[None, :, :], self.height[:, None] - self.tall[None, :]
        d = d * d
        bits = (d[:, :, 0] + d[:, :, 1] + dz * dz).view(np.uint32)
        tagged = np.sort(bits & ~self.id_bits | np.arange(self.k, dtype=np.uint32), axis=1)
        label = (tagged[:, 0] & self.id_bits).astype(int)
        changed = int(np.count_nonzero(label != self.label))
        second = tagged[:, 1] if self.k > 1 else np.full(len(label), np.finfo(F).max, dtype=F).view(np.uint32)
        self.label = label
        self.near, self.next = ((t & ~self.id_bits).view(F) for t in (tagged[:, 0].copy(), second.copy()))
        self.second = (second & self.id_bits).astype(int)
        if changed:
            self.add_up()
        return changed

    def add_up(self):
        sums = lambda w: np.bincount(self.label, weights=w, minlength=self.k)
        w, (x, y) = self.weight, self.xy.T.astype(np.float64)
        self.sums = np.column_stack([sums(w * x), sums(w * y), sums(w), sums(w * self.height.astype(np.float64))])

    def centre(self, ids=None):
        for i in range(self.k) if ids is None else ids:
            if self.sums[i, 2] > 0:
                self.at[i] = self.sums[i, :2] / self.sums[i, 2]
                self.tall[i] = self.sums[i, 3] / self.sums[i, 2]

    def cost(self):
        return in_order(self.weight * self.near.astype(np.float64))

    def settle(self, most=None):
        """Until nothing changes. With `most`: returns False when the cost does not fall fast enough to come below it."""
        self.done, before = True, np.inf
        few = len(self.xy) // 1024
        for _ in range(ROUNDS):
            changed = self.assign()
            cost = self.cost()
            if most is not None and cost - FALLS * (before - cost) >= most:
                return False
            before = cost
            if changed > few:
                self.centre()
            elif self.move_single_contacts() <= few:
                return True
        self.done = self.assign() <= few
        return True

    def move_single_contacts(self):
        """Distances to the own and the second nearest centroid are those of the assignment, to the others as they are by now."""
        moved, most = 0, self.weight.max()
        for n, (x, y) in enumerate(self.xy.astype(np.float64)):
            own, w = self.label[n], self.weight[n]
            left = self.sums[own, 2] - w
            near = self.near[n]
            if self.stays(n, near, most) or left <= 0:
                continue
            to = self.cheapest(n, own)
            if to is None:
                continue
            dx, dy, dz = x - float(self.at[to, 0]), y - float(self.at[to, 1]), float(self.height[n] - self.tall[to])
            joined = self.sums[to, 2]
            if (dx * dx + dy * dy + dz * dz) * joined / (joined + w) < float(near) * self.sums[own, 2] / left * 0.999_999:
                for i, sign in ((own, -1.0), (to, 1.0)):
                    self.sums[i] += sign * w * np.array([x, y, 1.0, float(self.height[n])])
                self.centre((own, to))
                self.label[n] = to
                moved += 1
        return moved

    def cheapest(self, n, own):
        """The other cluster that a contact joins at the least cost, as far as single precision with room for the id tells."""
        d = self.xy[n] - self.at
        dz = self.height[n] - self.tall
        mass = self.sums[:, 2].astype(F)
        with np.errstate(over="ignore"):
            cost = (d[:, 0] * d[:, 0] + d[:, 1] * d[:, 1] + dz * dz) * (mass / (mass + F(self.weight[n])))
        bits = cost.view(np.uint32) & ~self.id_bits | np.arange(self.k, dtype=np.uint32)
        others = [int(b) for i, b in enumerate(bits) if i != own and self.sums[i, 2] > 0]
        return min(others) & int(self.id_bits) if others else None

    def stays(self, n, near, most):
        """Whether a contact stays whatever the weights of the others, `most` the greatest, as far as the two nearest centroids say."""
        heavy = self.sums[self.label[n], 2]
        if heavy - most <= 0:
            return not self.weighted
        lightest = self.sums[self.sums[:, 2] > 0, 2].min()
        times = F(heavy / (heavy - most) * (lightest + most) / lightest) * F(1.000_01)
        return near * times <= self.next[n]
