"""Runs `taxel eval`, the Rust kernels and the peers on the same frames, and writes results.json and report.md.

Whatever is timed is timed in each of several rounds; see rounds.py. Called by tests/peers/run, which makes what it needs. tables.py makes the tables of docs/benchmarks.md from results.json.
"""

import argparse
import json
import os
import platform
import sys
from pathlib import Path

import numpy as np
from scipy.optimize import linear_sum_assignment

import tables
from peers import Kmeans1d, Kmeans1dPython, OpenCv, ScikitLearn, overheads
from rounds import Eval, Kernels, Scaling, at, least, output

ROOT = Path(__file__).resolve().parents[2]
DATA = Path(os.environ.get("TAXEL_DATA", ROOT.parent / "shared/data"))
LEVELS, ACTUATORS = 8, 16
METHODS = ["paper", "optimal"]
HISTORIES = [0, 0.02, 0.05, 0.1, 0.2, 0.35, 0.5, 0.75, 1, 1.5, 2]
SWEEP = [2, 4, 8, 16, 32]
BEST_OF = 4000
# What a user might pick instead, and on how many frames of an input at most.
PEERS = [(OpenCv(1), 10**9), (OpenCv(10), 120), (ScikitLearn(1), 100), (ScikitLearn(10), 20), (Kmeans1d(), 300), (Kmeans1dPython(), 100)]
JUMP_GAINS = [0, 0.01, 0.02, 0.05, 0.1, 0.3]
# Six pressure arrays, stored transposed: the layout puts every cell in its place. Each taxel idles at a level of its own: forces are above the first frames' median.
SCHUNK_LAYOUT, SCHUNK_IDLE_FRAMES, SCHUNK_THRESHOLD = "schunk-sdh", 10, 10
# 10 is within the noise, where contacts flicker. With hysteresis a contact begins well above it and ends at it.
FLICKER = [("10", []), ("20", []), ("20, released at 10", ["--release", "10"])]
# Switches on their own, beside those that `taxel eval` judges by default.
PLACES = [[4 * (n % 4) + 1.5, 4 * (n // 4) + 1.5] for n in range(ACTUATORS)]
FIXED = "optimal fixed=" + json.dumps(PLACES, separators=(",", ":"))


def recordings(quick, trials=(0, 3, 7, 11)):
    """Name, arguments of `taxel eval`, and whether it is a real recording."""
    found = []
    tiled = ["--tile"]
    waseda = DATA / "uskin_waseda.npz"
    if waseda.exists():
        for array in ["debug_0B2Z_raw", "debug_0B0Z_raw"][: 1 if quick else 2]:
            args = [waseda, "--array", array, "--columns", "xyz-interleaved", *tiled]
            found.append((f"Waseda {array}, tiled", args, True))
    moves = DATA / "uskin_pick_and_move.npz"
    if moves.exists():
        for trial in [3] if quick else trials:
            args = [moves, "--array", f"trial{trial:02}", "--columns", "xyz-blocks", *tiled]
            found.append((f"pick and move {trial:02}, tiled", args, True))
    schunk = DATA / "schunk_sdh_grasps.npz"
    if schunk.exists():
        grasps = [name for name in np.load(schunk).files if not name.endswith("_joints")][:: 1 if quick else 5]
        for name in grasps[:1] if quick else grasps:
            args = [schunk, "--array", name, "--idle", str(SCHUNK_IDLE_FRAMES), "--layout", SCHUNK_LAYOUT]
            args += ["--threshold", str(SCHUNK_THRESHOLD), "--rate", "15"]
            found.append((f"Schunk {name}, six arrays", args, True))
    if not found:
        print(f"SKIPPED: every recording: {DATA} is not there (set TAXEL_DATA)", file=sys.stderr)
    for scene in ["ball-grasp"] if quick else ["ball-grasp", "slip", "worst-case"]:
        found.append((f"scene {scene}", [f"sim:{scene}"], False))
    return found


def sized(levels, actuators):
    return ["--levels", levels, "--actuators", actuators]


SIZE = sized(LEVELS, ACTUATORS)


def untimed(taxel, args, *more):
    return output([taxel, "eval", *args, *SIZE, "--json", *more, "--passes", 1])


def squared_error(a, b):
    return float(np.sum((a - b) ** 2))


def place_error(pixels, labels):
    """From cluster means, as k-means has it; the places of the members nearest the means."""
    total, snapped = 0.0, {}
    for label in np.unique(labels):
        members = pixels[labels == label]
        distances = np.sum((members - members.mean(axis=0)) ** 2, axis=1)
        total += float(distances.sum())
        snapped[label] = members[int(np.argmin(distances))]
    return total, np.array(list(snapped.values()))


def jump_px(taxels):
    """A move beyond this is a jump, as `taxel eval` has it."""
    return 2 * max(taxels**0.5 / 16, 1)


def jumps(before, now, jump):
    """Actuators matched so that they move least in all, which no peer does for its user: jumps and pairs."""
    if before is None or len(before) == 0 or len(now) == 0:
        return 0, 0
    distances = np.linalg.norm(before[:, None] - now[None], axis=2)
    moved = distances[linear_sum_assignment(distances**2)]
    return int(np.sum(moved > jump)), len(moved)


def displayed_error(forces, shown, labels):
    """Squared error from the forces to those that actuators press with: an actuator has the level closest to its contacts' mean force,
    as `optimal` has it, and the level of its contact where it is one's alone. `shown` is the force of each contact's level."""
    levels, error = np.unique(shown), 0.0
    for label in np.unique(labels):
        of = labels == label
        mean = forces[of].mean()
        pressed = shown[of][0] if np.count_nonzero(of) == 1 else levels[np.argmin((levels - mean) ** 2)]
        error += squared_error(forces[of], pressed)
    return error


def displayed_nrmse(peer, contact, force, xy):
    """Over all contacts of all frames. Where there is nothing to cluster, every force has its level and every contact its actuator."""
    error = squares = 0.0
    for t in np.flatnonzero(contact.any(axis=1)):
        forces, pixels = force[t][contact[t]], np.ascontiguousarray(xy[contact[t]])
        shown = peer.levels(forces, LEVELS, t)[0] if len(np.unique(forces)) > LEVELS else forces
        labels = peer.places(pixels, ACTUATORS, t)[0] if len(forces) > ACTUATORS else np.arange(len(forces))
        error += displayed_error(forces, shown, labels)
        squares += float(np.sum(forces**2))
    return (error / squares) ** 0.5


def has_work(forces):
    return len(forces) > ACTUATORS and len(np.unique(forces)) > LEVELS


class Peer:
    """A peer on frames with more contacts than actuators and more different forces than levels: on all of them, or on `most` evenly spread
    ones. Jumps are counted where all are run. In a round, the time of a frame is the best of a few calls."""

    def __init__(self, peer, most):
        self.peer, self.most = peer, most
        self.errors, self.level_times, self.times = None, [], []

    def measure(self, frames):
        times, level_times, force_ratios, place_ratios, jumped, kept = [], [], [], [], 0, 0
        before = None
        places = hasattr(self.peer, "places")
        contact = frames["contact"].astype(bool)
        xy = np.stack([frames["x"], frames["y"]], axis=1).astype(np.float64)
        hard = sum(1 for t in range(len(contact)) if has_work(frames["force"][t][contact[t]]))
        step = max(1, -(-hard // self.most))
        done = 0
        for t in range(len(contact)):
            forces, pixels = frames["force"][t][contact[t]], np.ascontiguousarray(xy[contact[t]])
            if not has_work(forces):
                before = None
                continue
            done += 1
            if done % step:
                continue
            shown, us = self.peer.levels(forces, LEVELS, t)
            level_times.append(us)
            force_ratios.append(squared_error(forces, shown) / frames["level_error"][t])
            if places:
                labels, place_us = self.peer.places(pixels, ACTUATORS, t)
                us += place_us
                error, now = place_error(pixels, labels)
                place_ratios.append(error / frames["place_error"][t])
                if step == 1:
                    j, k = jumps(before, now, jump_px(contact.shape[1]))
                    jumped, kept, before = jumped + j, kept + k, now
            times.append(us)
        self.times.append(times)
        self.level_times.append(level_times)
        if not times or self.errors is not None:
            return
        self.errors = {
            "name": self.peer.name,
            "frames": len(times),
            "force_sse_ratio_mean": float(np.mean(force_ratios)),
            "force_sse_ratio_p50": at(force_ratios, 0.5),
            "force_sse_ratio_p95": at(force_ratios, 0.95),
            "force_optimal_fraction": float(np.mean(np.array(force_ratios) <= 1 + 1e-9)),
        }
        if places:
            self.errors |= {
                "position_sse_ratio_mean": float(np.mean(place_ratios)),
                "position_sse_ratio_p95": at(place_ratios, 0.95),
                "jump_fraction": jumped / kept if kept else None,
                # The ten attempts of a peer on every frame would take an hour.
                "displayed_nrmse": displayed_nrmse(self.peer, contact, frames["force"], xy) if self.peer.is_quick else None,
            }

    def result(self):
        """Nothing where no frame had work."""
        if self.errors is None:
            return None
        level_times, times = least(self.level_times), least(self.times)
        result = self.errors | {
            "levels_us_p50": at(level_times, 0.5),
            "levels_us_p99": at(level_times, 0.99),
        }
        if hasattr(self.peer, "places"):
            result |= {"both_us_p50": at(times, 0.5), "both_us_p99": at(times, 0.99)}
        return result


class Overheads:
    """What a call of each peer costs that has nothing to do."""

    def __init__(self):
        self.rounds = []

    def measure(self):
        self.rounds.append({peer.name: overheads(peer) for peer, _ in PEERS})

    def result(self):
        return {name: {stage: min(r[name][stage] for r in self.rounds) for stage in first} for name, first in self.rounds[0].items()}


class Recording:
    """One input with all that runs on its frames."""

    def __init__(self, name, args, real, options, folder):
        self.name, self.real = name, real
        self.file = folder / (name.replace(" ", "_").replace(",", "") + ".npz")
        methods = [a for m in METHODS for a in ("--method", m)]
        self.eval = Eval(options.taxel, args, *SIZE, *methods, export=self.file, times=folder / "times.npz")
        self.kernels = Kernels(options.kernels, self.file, LEVELS)
        self.peers = [Peer(peer, most) for peer, most in PEERS]

    def has_contacts(self):
        return self.eval.report["contact_frames"] > 0

    def measure(self):
        self.eval.measure()
        if not self.has_contacts():
            print(f"\n{self.name}: no contact in any of {self.eval.report['frames']} frames")
            return
        frames = dict(np.load(self.file))
        for peer in self.peers:
            peer.measure(frames)
        self.kernels.measure()

    def result(self, overheads):
        peers = [result | {"overhead_us": overheads[result["name"]]} for peer in self.peers if (result := peer.result())]
        return {"name": self.name, "real": self.real, "eval": self.eval.result(), "peers": peers, "kernels": self.kernels.result()}


def machine():
    model = "unknown processor"
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                model = line.split(":", 1)[1].strip()
                break
    except OSError:
        pass
    import cv2
    import sklearn

    versions = f"Python {platform.python_version()}, scikit-learn {sklearn.__version__}, OpenCV {cv2.__version__}, numpy {np.__version__}"
    return f"{model}, {os.cpu_count()} cores; {versions}"


def flicker(taxel, inputs, measured):
    """Recordings of magnitudes with several thresholds."""
    found = []
    methods = [a for m in (*METHODS, "optimal jump_gain=0.1", "optimal jump_gain=0.3") for a in ("--method", m)]
    for name, args, _ in inputs:
        if "--threshold" not in args:
            continue
        where = args.index("--threshold") + 1
        runs = []
        for label, more in FLICKER:
            changed = [*args[:where], label.split(",")[0], *args[where + 1 :], *more]
            runs.append({"threshold": label, "eval": untimed(taxel, changed, *methods)})
        peer = next((p for r in measured if r["name"] == name for p in r["peers"] if p["name"].startswith("OpenCV kmeans, 1 ")), {})
        found.append({"name": name, "runs": runs, "opencv_jump_fraction": peer.get("jump_fraction")})
    return found


def display(taxel, inputs):
    """What the display shows in the end, both stages together."""
    methods = ["paper", "optimal", "optimal force_distance=0", "optimal actuator_force=max", "optimal force_weighted=true"]
    more = [a for m in methods for a in ("--method", m)]
    return [{"name": name, "eval": untimed(taxel, args, *more)} for name, args, _ in inputs]


def best(taxel, inputs):
    """Positions against the best of many more runs than are made for the other tables."""
    more = ["--restarts", BEST_OF, *(a for m in METHODS for a in ("--method", m))]
    found = [{"name": name, "eval": untimed(taxel, args, *more)} for name, args, _ in inputs]
    return [f for f in found if f["eval"]["methods"][0]["position_frames"]]


def history(taxel, inputs, first):
    """Error against movement."""
    chosen = (first, "Schunk ORANGE_FRESH_1300205837, six arrays", "scene ball-grasp", "scene slip")
    methods = [f"optimal history={h}" for h in HISTORIES] + ["paper"] + [f"optimal jump_gain={g}" for g in JUMP_GAINS]
    more = [a for m in methods for a in ("--method", m)]
    return [{"name": name, "eval": untimed(taxel, args, *more)} for name, args, _ in inputs if name in chosen]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--taxel", required=True)
    parser.add_argument("--kernels", required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--rounds", type=int, help="how often everything is timed, one round after the other (3; 1 with --quick)")
    options = parser.parse_args()
    rounds = options.rounds or (1 if options.quick else 3)
    frames_dir = options.out / "frames"
    frames_dir.mkdir(parents=True, exist_ok=True)
    times = frames_dir / "times.npz"
    methods = [a for m in METHODS for a in ("--method", m)]
    inputs = recordings(options.quick)
    first = inputs[0]

    measured = [Recording(name, args, real, options, frames_dir) for name, args, real in inputs]
    # Every switch of the method on one recording, and a display with fixed actuators.
    standard = Eval(options.taxel, first[1], *SIZE, times=times)
    fixed = Eval(options.taxel, first[1], *SIZE, "--method", FIXED, times=times)
    sweep = [Eval(options.taxel, first[1], *sized(k, k), *methods, times=times) for k in SWEEP]
    scaling = Scaling(options.taxel, *SIZE, *methods)
    kernel_scaling = Kernels(options.kernels, "--made-up", LEVELS)
    calls = Overheads()
    others = [("calls of peers", [calls]), ("switches", [standard, fixed]), ("sweep", sweep), ("scaling", [scaling, kernel_scaling])]
    for n in range(rounds):
        for name, each in [*((r.name, [r]) for r in measured), *others]:
            print(f"round {n + 1} of {rounds}: {name}", file=sys.stderr, flush=True)
            for timed in each:
                timed.measure()
        measured = [r for r in measured if r.has_contacts()]

    results = {"machine": machine(), "rounds": rounds, "levels": LEVELS, "actuators": ACTUATORS}
    print(results["machine"])
    results["recordings"] = [recording.result(calls.result()) for recording in measured]
    for recording in results["recordings"]:
        print(f"\n### {recording['name']}\n\n{tables.peers(recording)}", flush=True)
    results["switches"] = standard.result()
    results["switches"]["methods"].append(fixed.result()["methods"][0] | {"name": "optimal fixed=16 places, 4 x 4"})
    results["sweep"] = [size.result() for size in sweep]
    results["scaling"] = scaling.result()
    results["kernel_scaling"] = kernel_scaling.result()
    results["display"] = display(options.taxel, [i for i in inputs if i[0] in [r.name for r in measured]])
    results["history"] = history(options.taxel, recordings(False), first[0])
    results["best"] = best(options.taxel, recordings(options.quick, range(12)))
    results["flicker"] = flicker(options.taxel, inputs, results["recordings"])
    (options.out / "results.json").write_text(json.dumps(results, indent=1))
    (options.out / "report.md").write_text(tables.report(results))
    print(f"\n{tables.summary(results)}\n\n{tables.figures(results)}")
    print(f"\n{options.out / 'results.json'} and report.md written", file=sys.stderr)


if __name__ == "__main__":
    main()
