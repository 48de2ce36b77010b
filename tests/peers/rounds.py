"""Times measured in rounds: a frame's time is the least of its rounds', for every program alike.

Rounds are spread over the whole run, so that a neighbour on the machine who spoils an input in one of them is gone in another. Errors are the first
round's: they are the same in all.
"""

import json
import subprocess

import numpy as np


def at(values, q):
    """The nearest rank, so always one of the values; 0 of nothing."""
    return float(np.quantile(values, q, method="inverted_cdf")) if len(values) else 0.0


def quantiles(times):
    return {"p50": at(times, 0.5), "p99": at(times, 0.99), "p999": at(times, 0.999), "max": at(times, 1)}


def least(rounds):
    """Of (rounds, frames) times, each frame's least."""
    return np.min(np.array(rounds, dtype=np.float64), axis=0)


def output(command):
    return json.loads(subprocess.run([str(c) for c in command], stdout=subprocess.PIPE, check=True).stdout)


class Eval:
    """`taxel eval` on one input. In a round, the time of a frame is its median over the passes."""

    def __init__(self, taxel, args, *more, export=None, times):
        self.command = [taxel, "eval", *args, *more, "--json", "--times", times]
        self.export, self.times = export, times
        self.report, self.rounds = None, []

    def measure(self):
        if self.report is None:
            self.report = output([*self.command, *(["--export", self.export] if self.export else [])])
        else:
            # What errors are compared with is not looked for again.
            output([*self.command, "--restarts", 1])
        with np.load(self.times) as laps:
            self.rounds.append((laps["condition_us"], laps["compress_us"]))

    def result(self):
        """The report with the times of all rounds."""
        return self.report | {"methods": [m | self.cost(n) for n, m in enumerate(self.report["methods"])]}

    def cost(self, method):
        condition = [condition[method] for condition, _ in self.rounds]
        compress = [compress[method] for _, compress in self.rounds]
        tick = [a + b for a, b in zip(condition, compress)]
        of_frames = lambda laps: [np.quantile(frames, 0.5, axis=1, method="inverted_cdf") for frames in laps]
        us = quantiles(least(of_frames(tick)))
        return {
            "tick_us_p50": us["p50"],
            "tick_us_p99": us["p99"],
            "tick_us_p999": us["p999"],
            "condition_us": quantiles(least(of_frames(condition))),
            "compress_us": quantiles(least(of_frames(compress))),
            "every_tick_us": quantiles(np.concatenate(tick, axis=None)),
            "tick_us_p50_of_each_round": [at(frames, 0.5) for frames in of_frames(tick)],
        }


class Scaling:
    """`taxel eval --scaling`. It gives quantiles, each frame the least of a few passes; here they are the least of the rounds'."""

    def __init__(self, taxel, *more):
        self.command = [taxel, "eval", "sim:tap", *more, "--scaling", "--passes", 1, "--json"]
        self.rounds = []

    def measure(self):
        self.rounds.append(output(self.command)["scaling"])

    def result(self):
        def method(name, of_rounds):
            return [name, {q: min(us[q] for us in of_rounds) for q in of_rounds[0]}]

        def size(of_rounds):
            methods = zip(*(of_round["methods"] for of_round in of_rounds))
            return of_rounds[0] | {"methods": [method(m[0][0], [us for _, us in m]) for m in methods]}

        return [size(of_rounds) for of_rounds in zip(*self.rounds)]


class Kernels:
    """The Rust kernels on exported or made-up frames. In a round, the time of a frame is the least of some passes."""

    def __init__(self, program, *args):
        self.command, self.rounds = [program, *args], []

    def measure(self):
        self.rounds.append(output(self.command))

    def result(self):
        if isinstance(self.rounds[0], list):
            of_sizes = zip(*self.rounds)
            return [sizes[0] | {"kernels": merged_kernels([s["kernels"] for s in sizes])} for sizes in of_sizes]
        return merged_kernels(self.rounds)


def merged_kernels(rounds):
    def value(name, first):
        if not isinstance(first, list):
            return first
        times = least([r[name] for r in rounds])
        return {"p50_us": at(times, 0.5), "p99_us": at(times, 0.99)}

    return {name: value(name, first) for name, first in rounds[0].items()}
