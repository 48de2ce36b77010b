"""Sequential clustering for tactile image compression, in numpy.

An implementation of Table I of Geier et al. (IROS 2019) of its own, written from the publication and from
`docs/algorithm.md`, which settles what the publication leaves open. It shares nothing with the Rust one, so that
images that agree to the bit say something. Equation numbers are the publication's.
"""

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Profile:
    """Inputs of Table I. Names and defaults are those of the daemon's `[profile]` table."""

    levels: int = 8  # K_D
    actuators: int = 16  # K_A
    force_iterations: int = 10  # I_D
    actuator_iterations: int = 10  # I_A
    grey: str = "level"  # or "centroid"
    actuator_force: str = "max"  # or "mean" or "closest"
    force_weighted: bool = False
    codebook: tuple = ()  # mark (*): constant force levels


@dataclass
class Image:
    """The tactile image rho''_t and what is told with it."""

    pixels: np.ndarray  # (height, width) uint8
    levels: list = field(default_factory=list)  # force of each level, ascending
    actuators: list = field(default_factory=list)  # (id, x, y, level, force)
    contacts: int = 0  # N_C
    faulty: int = 0
    missing: int = 0


def compress(force, contact, faulty, missing, taxel_xy, shape, profile=Profile()):
    """One tactile image.

    force: (N,) relative magnitudes rho~_t.  contact, faulty, missing: (N,) bool; `faulty` is any fault other than a
    missing value.  taxel_xy: (N, 2) column and row of each taxel.  shape: (height, width) of the image.
    """
    force = np.asarray(force, dtype=np.float64)
    xy = np.asarray(taxel_xy)
    contacting, refused = contact_list(force, contact, faulty | missing, xy)
    image = Image(
        pixels=np.zeros(shape, dtype=np.uint8),
        levels=[float(f) for f in profile.codebook],
        contacts=len(contacting),
        faulty=int(np.sum(faulty & ~missing)) + refused,
        missing=int(np.sum(missing)),
    )
    if len(contacting) == 0:
        return image

    rho, c = force[contacting], xy[contacting].astype(np.float64)
    mu, level = quantise_force(rho, profile)
    image.levels = [float(f) for f in mu]

    if len(c) <= profile.actuators:  # eq. (12)
        placed = list(range(len(c)))
        pressed = level
        ids = range(len(c))
    else:
        a, centroids = quantise_actuators(c, rho, profile)
        ids = [k for k in range(len(centroids)) if np.any(a == k)]
        placed = [medoid(c, a, k, centroids[k]) for k in ids]
        pressed = [cluster_level(level[a == k], rho[a == k], mu, profile) for k in ids]

    grey = greys(mu, profile)
    for k, n, l in zip(ids, placed, pressed):
        x, y = (int(v) for v in c[n])
        image.pixels[y, x] = grey[l - 1]
        image.actuators.append((int(k), x, y, int(l), float(mu[l - 1])))
    return image


def contact_list(force, contact, unusable, xy):
    """Indices of the contacting taxels in raster order, and how many usable taxels were refused for their force."""
    contact, unusable = np.asarray(contact, dtype=bool), np.asarray(unusable, dtype=bool)
    in_range = np.isfinite(force) & (force >= 1 / 1e38) & (force <= 1e38)
    listed = contact & ~unusable & in_range
    refused = ~unusable & (~np.isfinite(force) | (contact & ~in_range))
    n = np.flatnonzero(listed)
    return n[np.lexsort((xy[n, 0], xy[n, 1]))], int(np.sum(refused))


def quantise_force(rho, profile):
    """Eqs (3) to (7): the force of each level, ascending, and each contact's level 1..K."""
    if profile.codebook:
        mu = np.array(profile.codebook, dtype=np.float64)
        return mu, nearest(rho, mu) + 1

    k = profile.levels
    m, big_m = rho.min(), rho.max()
    mu = m + ((np.arange(1, k + 1) - 0.5) * (big_m - m)) / k  # (3)
    for _ in range(profile.force_iterations):
        a = nearest(rho, mu)  # (4), (5)
        mu = cluster_means(rho, np.ones_like(rho), a, mu)  # (6)
    ascending = np.argsort(mu, kind="stable")
    number = np.empty(k, dtype=int)
    number[ascending] = np.arange(1, k + 1)
    level = number[a]
    level[level == level[np.argmax(rho)]] = k
    return mu[ascending], level  # (7)


def quantise_actuators(c, rho, profile):
    """Eqs (8) to (11): each contact's cluster and the centroids, (K_A, 2)."""
    mu = maximin(c, profile.actuators)  # (8)
    weight = rho if profile.force_weighted else np.ones(len(c))
    for _ in range(profile.actuator_iterations):
        a = np.argmin(squared_distances(c, mu), axis=1)  # (9), (10)
        mu = np.column_stack([cluster_means(c[:, i], weight, a, mu[:, i]) for i in (0, 1)])  # (11)
    return a, mu


def maximin(c, k):
    """The first contact, then again and again the one that is farthest from those chosen."""
    chosen = [0]
    while len(chosen) < k:
        to_nearest = squared_distances(c, c[chosen]).min(axis=1)
        chosen.append(int(np.argmax(to_nearest)))
    return c[chosen]


def nearest(values, mu):
    """Index of the centroid with the least squared difference; the lowest among equals."""
    difference = values[:, None] - mu[None, :]
    return np.argmin(difference * difference, axis=1)


def squared_distances(c, mu):
    dx = c[:, None, 0] - mu[None, :, 0]
    dy = c[:, None, 1] - mu[None, :, 1]
    return dx * dx + dy * dy


def cluster_means(values, weight, a, mu):
    """Weighted mean of each cluster's members, summed in the order of the contacts; an empty one keeps its centroid.

    `bincount` adds one term after the other, which `sum` does not.
    """
    k = len(mu)
    members = np.bincount(a, minlength=k)
    total = np.bincount(a, weights=weight, minlength=k)
    weighted = np.bincount(a, weights=weight * values, minlength=k)
    return np.where(members > 0, weighted / np.where(members > 0, total, 1.0), mu)


def medoid(c, a, k, centroid):
    """The member of cluster k nearest to its centroid; the first among equals."""
    members = np.flatnonzero(a == k)
    return members[np.argmin(squared_distances(c[members], centroid[None, :])[:, 0])]


def cluster_level(levels, rho, mu, profile):
    """The level an actuator presses with, for the levels and forces of its contacts."""
    if profile.actuator_force == "max" or len(levels) == 1:
        return int(levels.max())
    forces = mu[levels - 1] if profile.actuator_force == "mean" else rho
    mean = np.cumsum(forces)[-1] / len(levels)
    return int(np.flatnonzero(mu == mu[nearest(np.array([mean]), mu)[0]])[-1]) + 1


def spread(levels, numbers, most):
    """The K levels that the method `optimal` found, as the `most` levels of the display, and the contacts' numbers there."""
    ends = [0] + [(2 * k * most + len(levels)) // (2 * len(levels)) for k in range(1, len(levels) + 1)]
    spread_levels = [force for force, begin, end in zip(levels, ends, ends[1:]) for _ in range(begin, end)]
    return spread_levels, np.array(ends)[numbers]


def greys(mu, profile):
    """The 8-bit grey of each level."""
    if profile.grey == "level":
        k = np.arange(1, len(mu) + 1)
        return (510 * k + profile.levels) // (2 * profile.levels)
    return np.maximum(1, np.floor((255 * mu) / mu.max() + 0.5)).astype(int)
