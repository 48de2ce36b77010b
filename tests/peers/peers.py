"""The programs taxeld is compared with, each as one call for the force levels and one for the actuators of a frame.

A peer gets the forces (float64, N) and pixels (float64, N x 2) of the contacts and returns levels (one force per contact) and labels (one cluster per
contact). Arrays are converted to what the library wants outside the timed call; results are converted back outside it too.
"""

import ctypes
import time

import cv2
import kmeans1d
import numpy as np
from sklearn.cluster import KMeans

cv2.setNumThreads(1)


REPEATS = 3


def clock(call):
    """The result of a call, and the best time of a few in microseconds: what else the machine does is not held against a peer."""
    best = float("inf")
    for _ in range(REPEATS):
        begin = time.perf_counter_ns()
        result = call()
        best = min(best, time.perf_counter_ns() - begin)
    return result, best / 1e3


class ScikitLearn:
    def __init__(self, starts):
        self.starts = starts
        self.is_quick = starts == 1
        self.name = f"scikit-learn KMeans, {starts} start{'s' if starts > 1 else ''}"

    def _fit(self, points, k, seed):
        model = KMeans(n_clusters=k, n_init=self.starts, random_state=seed)
        _, us = clock(lambda: model.fit(points))
        return model.cluster_centers_, model.labels_, us

    def levels(self, forces, k, seed):
        centres, labels, us = self._fit(np.ascontiguousarray(forces[:, None]), k, seed)
        return centres[labels, 0], us

    def places(self, pixels, k, seed):
        _, labels, us = self._fit(pixels, k, seed)
        return labels, us


class OpenCv:
    """k-means++ centres, until no centre moves more than 0.01 or 100 iterations; float32, as cv2.kmeans wants it."""

    def __init__(self, attempts):
        self.attempts = attempts
        self.is_quick = attempts == 1
        self.name = f"OpenCV kmeans, {attempts} attempt{'s' if attempts > 1 else ''}"

    def _fit(self, points, k):
        criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 100, 0.01)
        points = np.ascontiguousarray(points, dtype=np.float32)
        (_, labels, centres), us = clock(
            lambda: cv2.kmeans(points, k, None, criteria, self.attempts, cv2.KMEANS_PP_CENTERS)
        )
        return centres, labels[:, 0], us

    def levels(self, forces, k, seed):
        cv2.setRNGSeed(seed + 1)  # of the first of the repeats; the result is the last's
        # float32 loses nothing of its labels; levels are the means of its clusters in float64.
        _, labels, us = self._fit(forces[:, None], k)
        return means(forces, labels, k), us

    def places(self, pixels, k, seed):
        cv2.setRNGSeed(seed + 1)
        _, labels, us = self._fit(pixels, k)
        return labels, us


class Kmeans1d:
    """The package's C++ function, called with arrays that are ready (its Python wrapper converts lists, which is not clustering)."""

    name = "kmeans1d, its C++ called directly"
    _dll = ctypes.CDLL(kmeans1d._core.__file__)

    def levels(self, forces, k, seed):
        n = len(forces)
        values = (ctypes.c_double * n)(*forces)
        labels, centres = (ctypes.c_ulong * n)(), (ctypes.c_double * k)()
        cluster, c_n, c_k = self._dll.cluster, ctypes.c_ulong(n), ctypes.c_ulong(k)
        _, us = clock(lambda: cluster(values, c_n, c_k, labels, centres))
        return means(forces, np.array(labels[:]), k), us


class Kmeans1dPython:
    name = "kmeans1d, from Python"

    def levels(self, forces, k, seed):
        values = forces.tolist()
        result, us = clock(lambda: kmeans1d.cluster(values, k))
        return means(forces, np.array(result.clusters), k), us


def means(forces, labels, k):
    first = forces.min()
    counts = np.bincount(labels, minlength=k)
    sums = np.bincount(labels, weights=forces - first, minlength=k)
    return first + (sums / np.maximum(counts, 1))[labels]


def overheads(peer, repeats=300):
    """What a call costs that has nothing to do: two values, two clusters. Microseconds, median; levels and places."""
    forces, pixels = np.array([1.0, 2.0]), np.array([[0.0, 0.0], [5.0, 5.0]])
    result = {"levels": float(np.median([peer.levels(forces, 2, n)[1] for n in range(repeats)]))}
    if hasattr(peer, "places"):
        result["places"] = float(np.median([peer.places(pixels, 2, n)[1] for n in range(repeats)]))
    return result
