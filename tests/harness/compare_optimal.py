"""An image of the method `optimal` against what has the least error: levels to the byte, places by what must hold of them."""

import numpy as np
from exact_levels import optimal_levels
from sequential_clustering import compress, contact_list, greys, spread


class Frame:
    """What one frame's image is judged by. `force`, `contact`, `faulty`: (N,) of the conditioning's reference."""

    def __init__(self, hand, profile, force, contact, faulty):
        self.hand, self.profile = hand, profile
        nothing = np.zeros(len(force), dtype=bool)
        listed, _ = contact_list(force, contact, faulty, hand.xy)
        self.xy = hand.xy[listed].astype(float)
        self.rho = np.asarray(force)[listed]
        # The publication's image of the same frame, whose places are the ones to beat.
        self.papers = compress(force, contact, faulty, nothing, hand.xy, hand.shape, profile)
        self.faulty = int(np.sum(faulty))

    def check(self, image, where):
        """Fails where the image is not one that the method may make of the frame."""
        assert (image.contacts, image.faulty, image.missing) == (len(self.rho), self.faulty, 0), where
        levels = self.check_levels(image, where)
        if len(self.rho):
            self.check_places(image, levels, where)
        lit = {(a.x, a.y): greys(np.array(image.levels), self.profile)[a.level - 1] for a in image.actuators}
        pixels = np.frombuffer(image.pixels, np.uint8).reshape(image.height, image.width)
        assert {(int(x), int(y)): pixels[y, x] for y, x in np.argwhere(pixels)} == lit, where

    def check_levels(self, image, where):
        """Every level to the byte: those of the least error. Returns the level of each contact."""
        if len(self.rho) == 0:
            assert image.levels == () and image.actuators == (), where
            return None
        possible = optimal_levels(self.rho, self.profile.levels)
        for found, numbers in possible:
            self.levels, numbers = spread(found, numbers, self.profile.levels)
            if list(image.levels) == [float(np.float32(v)) for v in self.levels]:
                return numbers
        raise AssertionError(f"{where}: levels {image.levels}, but the optimum is {[levels for levels, _ in possible][:3]}")

    def check_places(self, image, levels, where):
        at = {(int(x), int(y)): level for (x, y), level in zip(self.xy, levels)}
        actuators = image.actuators
        stand = [(a.x, a.y) for a in actuators]
        assert len(set(stand)) == len(stand) and set(stand) <= at.keys(), f"{where}: not each on a contact of its own"
        ids = [a.id for a in actuators]
        assert len(set(ids)) == len(ids) and max(ids) < self.profile.actuators, where
        assert all(a.force == image.levels[a.level - 1] for a in actuators), where
        if len(at) <= self.profile.actuators:  # eq. (12)
            assert {(a.x, a.y): a.level for a in actuators} == at, where
            return
        shown = [a.force for a in actuators]
        # Means of forces: single precision may round beyond the least and the greatest.
        assert self.rho.min() * (1 - 1e-6) <= min(shown) <= max(shown) <= self.rho.max() * (1 + 1e-6), where

    def cost(self, stand, parts=None):
        """Squared distances of the contacts, weighted where the profile says so, from the means of those with the same nearest
        actuator (of the same part)."""
        stand = np.asarray(stand, dtype=float)
        apart = self.xy[:, None, :] - stand[None, :, :]
        squared = np.sum(apart * apart, axis=2)
        if parts is not None:
            squared = np.where(parts(self.xy)[:, None] == parts(stand)[None, :], squared, np.inf)
            assert np.all(np.isfinite(squared.min(axis=1))), "a part has contacts and no actuator"
        nearest = np.argmin(squared, axis=1)
        weight = self.rho if self.profile.force_weighted else np.ones(len(self.rho))
        total = 0.0
        for k in set(nearest):
            own, w = self.xy[nearest == k], weight[nearest == k, None]
            total += np.sum(w * (own - np.sum(w * own, axis=0) / np.sum(w)) ** 2)
        return total / weight.mean()

    def costs(self, image, parts=None):
        """The cost of the image's places and of the publication's; None where every contact has its own actuator."""
        if len(self.rho) <= self.profile.actuators:
            return None
        return self.cost([(a.x, a.y) for a in image.actuators], parts), self.cost([a[1:3] for a in self.papers.actuators])
