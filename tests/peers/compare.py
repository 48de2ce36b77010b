"""Runs `taxel eval`, the Rust kernels and the peers on the same frames, and writes results.json and report.md.

Called by tests/peers/run, which makes what it needs. tables.py makes the tables of docs/benchmarks.md from results.json.
"""

import argparse
import json
import os
import platform
import subprocess
import sys
from pathlib import Path

import numpy as np
from scipy.optimize import linear_sum_assignment

import tables
from peers import Kmeans1d, Kmeans1dPython, OpenCv, ScikitLearn, overheads

ROOT = Path(__file__).resolve().parents[2]
DATA = Path(os.environ.get("TAXEL_DATA", ROOT.parent / "shared/data"))
LEVELS, ACTUATORS = 8, 16
METHODS = ["paper", "optimal"]
HISTORIES = [0, 0.02, 0.05, 0.1, 0.2, 0.35, 0.5, 0.75, 1, 1.5, 2]
JUMP_GAINS = [0, 0.01, 0.02, 0.05, 0.1, 0.3]
# Six pressure arrays of 14 or 13 rows of six, one below the other. Each taxel idles at a level of its own: forces are above the first frames' median.
SCHUNK_LAYOUT, SCHUNK_IDLE_FRAMES, SCHUNK_THRESHOLD = "grid:81x6", 10, 10
# 10 is within the noise, where contacts flicker. With hysteresis a contact begins well above it and ends at it.
FLICKER = [("10", []), ("20", []), ("20, released at 10", ["--release", "10"])]
# Switches on their own, beside those that `taxel eval` judges by default.
PLACES = [[4 * (n % 4) + 1.5, 4 * (n // 4) + 1.5] for n in range(ACTUATORS)]
FIXED = "optimal fixed=" + json.dumps(PLACES, separators=(",", ":"))


def recordings(quick, folder):
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
        for trial in [3] if quick else [0, 3, 7, 11]:
            args = [moves, "--array", f"trial{trial:02}", "--columns", "xyz-blocks", *tiled]
            found.append((f"pick and move {trial:02}, tiled", args, True))
    schunk = DATA / "schunk_sdh_grasps.npz"
    if schunk.exists():
        arrays = np.load(schunk)
        grasps = [name for name in arrays.files if not name.endswith("_joints")][:: 1 if quick else 5]
        for name in grasps[:1] if quick else grasps:
            values = arrays[name].astype(np.float64)
            file = folder / f"schunk_{name}.npy"
            np.save(file, np.maximum(values - np.median(values[:SCHUNK_IDLE_FRAMES], axis=0), 0.0))
            args = [file, "--layout", SCHUNK_LAYOUT, "--threshold", str(SCHUNK_THRESHOLD), "--rate", "15"]
            found.append((f"Schunk {name}, six arrays", args, True))
    if not found:
        print(f"SKIPPED: every recording: {DATA} is not there (set TAXEL_DATA)", file=sys.stderr)
    for scene in ["ball-grasp"] if quick else ["ball-grasp", "slip", "worst-case"]:
        found.append((f"scene {scene}", [f"sim:{scene}"], False))
    return found


def taxel_eval(taxel, args, *more):
    command = [taxel, "eval", *args, "--levels", LEVELS, "--actuators", ACTUATORS, "--json", *more]
    result = subprocess.run([str(c) for c in command], stdout=subprocess.PIPE, check=True)
    return json.loads(result.stdout)


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


def jumps(before, now):
    """Actuators matched so that they move least in all, which no peer does for its user: jumps and pairs."""
    if before is None or len(before) == 0 or len(now) == 0:
        return 0, 0
    distances = np.linalg.norm(before[:, None] - now[None], axis=2)
    moved = distances[linear_sum_assignment(distances**2)]
    return int(np.sum(moved > 2)), len(moved)


def has_work(forces):
    return len(forces) > ACTUATORS and len(np.unique(forces)) > LEVELS


def run_peer(peer, frames, most):
    """A peer on frames with more contacts than actuators and more different forces than levels: on all of them, or on `most` evenly spread
    ones. Jumps are counted where all are run."""
    times, level_times, force_ratios, place_ratios, jumped, kept = [], [], [], [], 0, 0
    before = None
    places = hasattr(peer, "places")
    contact = frames["contact"].astype(bool)
    xy = np.stack([frames["x"], frames["y"]], axis=1).astype(np.float64)
    hard = sum(1 for t in range(len(contact)) if has_work(frames["force"][t][contact[t]]))
    step = max(1, -(-hard // most))
    done = 0
    for t in range(len(contact)):
        forces, pixels = frames["force"][t][contact[t]], np.ascontiguousarray(xy[contact[t]])
        if not has_work(forces):
            before = None
            continue
        done += 1
        if done % step:
            continue
        shown, us = peer.levels(forces, LEVELS, t)
        level_times.append(us)
        force_ratios.append(squared_error(forces, shown) / frames["level_error"][t])
        if places:
            labels, place_us = peer.places(pixels, ACTUATORS, t)
            us += place_us
            error, now = place_error(pixels, labels)
            place_ratios.append(error / frames["place_error"][t])
            if step == 1:
                j, k = jumps(before, now)
                jumped, kept, before = jumped + j, kept + k, now
        times.append(us)
    if not times:
        return None
    at = lambda values, q: float(np.quantile(values, q, method="inverted_cdf"))
    result = {
        "name": peer.name,
        "frames": len(times),
        "levels_us_p50": at(level_times, 0.5),
        "levels_us_p99": at(level_times, 0.99),
        "force_sse_ratio_mean": float(np.mean(force_ratios)),
        "force_sse_ratio_p50": at(force_ratios, 0.5),
        "force_sse_ratio_p95": at(force_ratios, 0.95),
        "force_optimal_fraction": float(np.mean(np.array(force_ratios) <= 1 + 1e-9)),
    }
    if places:
        result |= {
            "both_us_p50": at(times, 0.5),
            "both_us_p99": at(times, 0.99),
            "position_sse_ratio_mean": float(np.mean(place_ratios)),
            "position_sse_ratio_p95": at(place_ratios, 0.95),
            "jump_fraction": jumped / kept if kept else None,
        }
    return result


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


def switches(taxel, args):
    """Every switch of the method on one recording, and a display with fixed actuators."""
    standard = taxel_eval(taxel, args)
    fixed = taxel_eval(taxel, args, "--method", FIXED)["methods"][0] | {"name": "optimal fixed=16 places, 4 x 4"}
    return standard | {"methods": [*standard["methods"], fixed]}


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
            runs.append({"threshold": label, "eval": taxel_eval(taxel, changed, *methods, "--passes", 1)})
        peer = next((p for r in measured if r["name"] == name for p in r["peers"] if p["name"].startswith("OpenCV kmeans, 1 ")), {})
        found.append({"name": name, "runs": runs, "opencv_jump_fraction": peer.get("jump_fraction")})
    return found


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--taxel", required=True)
    parser.add_argument("--kernels", required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--quick", action="store_true")
    options = parser.parse_args()
    frames_dir = options.out / "frames"
    frames_dir.mkdir(parents=True, exist_ok=True)
    methods = [a for m in METHODS for a in ("--method", m)]
    results = {"machine": machine(), "levels": LEVELS, "actuators": ACTUATORS, "recordings": []}
    print(results["machine"])
    overhead = {}
    for name, args, real in recordings(options.quick, frames_dir):
        file = frames_dir / (name.replace(" ", "_").replace(",", "") + ".npz")
        report = taxel_eval(options.taxel, args, *methods, "--export", file)
        if report["contact_frames"] == 0:
            print(f"\n{name}: no contact in any of {report['frames']} frames")
            continue
        frames = dict(np.load(file))
        every = 10**9
        peers = [(OpenCv(1), every), (OpenCv(10), 120), (ScikitLearn(1), 100), (ScikitLearn(10), 20), (Kmeans1d(), 300), (Kmeans1dPython(), 100)]
        measured = []
        for peer, most in peers:
            overhead.setdefault(peer.name, overheads(peer))
            result = run_peer(peer, frames, most)
            if result:
                measured.append(result | {"overhead_us": overhead[peer.name]})
        kernels = json.loads(subprocess.check_output([options.kernels, file, str(LEVELS)]))
        recording = {"name": name, "real": real, "eval": report, "peers": measured, "kernels": kernels}
        results["recordings"].append(recording)
        print(f"\n### {name}\n\n{tables.peers(recording)}", flush=True)

    first = next(iter(recordings(True, frames_dir)))
    history = [a for h in HISTORIES for a in ("--method", f"optimal history={h}")]
    baseline = ["--method", "paper", *(a for g in JUMP_GAINS for a in ("--method", f"optimal jump_gain={g}"))]
    results["history"] = []
    for name, args, _ in recordings(False, frames_dir):
        if name in (first[0], "Schunk ORANGE_FRESH_1300205837, six arrays", "scene ball-grasp", "scene slip"):
            results["history"].append({"name": name, "eval": taxel_eval(options.taxel, args, *history, *baseline, "--passes", 1)})
    sizes = taxel_eval(options.taxel, ["sim:tap"], *methods, "--scaling", "--passes", 1)
    results["scaling"] = sizes["scaling"]
    results["kernel_scaling"] = json.loads(subprocess.check_output([options.kernels, "--made-up", str(LEVELS)]))
    results["sweep"] = taxel_eval(options.taxel, first[1], *methods, "--sweep-k")["sweep"]
    results["switches"] = switches(options.taxel, first[1])
    results["flicker"] = flicker(options.taxel, recordings(options.quick, frames_dir), results["recordings"])
    (options.out / "results.json").write_text(json.dumps(results, indent=1))
    (options.out / "report.md").write_text(tables.report(results))
    print(f"\n{tables.summary(results)}\n\n{tables.figures(results)}")
    print(f"\n{options.out / 'results.json'} and report.md written", file=sys.stderr)


if __name__ == "__main__":
    main()
