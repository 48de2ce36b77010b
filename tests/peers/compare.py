"""Runs `taxel eval`, the Rust kernels and the peers on the same frames and prints the tables of docs/benchmarks.md.

Called by tests/peers/run, which makes what it needs.
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

from peers import Kmeans1d, Kmeans1dPython, OpenCv, ScikitLearn, overheads

ROOT = Path(__file__).resolve().parents[2]
DATA = Path(os.environ.get("TAXEL_DATA", ROOT.parent / "shared/data"))
LEVELS, ACTUATORS = 8, 16
METHODS = ["paper", "optimal"]
HISTORIES = [0, 0.02, 0.05, 0.1, 0.2, 0.35, 0.5, 0.75, 1, 1.5, 2]
JUMP_GAINS = [0, 0.01, 0.02, 0.05, 0.1, 0.3]
# Six pressure arrays of 14 or 13 rows of six, one below the other. Each taxel idles at a level of its own: forces are above the first frames' median.
SCHUNK_LAYOUT, SCHUNK_IDLE_FRAMES, SCHUNK_THRESHOLD = "grid:81x6", 10, 10


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


def number(value, form=".2f"):
    return "" if value is None else format(value, form)


def percent(value):
    return "" if value is None else f"{100 * value:.1f} %"


def table_of(recording):
    """Both stages: time and error beside `optimal`."""
    rows = [
        "| program | both stages, us p50 | p99 | times optimal's | less call overhead | force SSE p50 | mean | p95 | frames optimal | position SSE mean | p95 | jumps |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    methods = recording["eval"]["methods"]
    own = next(m for m in methods if m["name"] == "optimal")["compress_us"]["p50"]
    for m in methods:
        us = m["compress_us"]
        rows.append(
            f"| taxeld `{m['name']}` | {us['p50']:.1f} | {us['p99']:.1f} | {us['p50'] / own:.1f} | | {m['force_sse_ratio_p50']:.3f} |"
            f" {m['force_sse_ratio_mean']:.3g} | {m['force_sse_ratio_p95']:.3g} | {percent(m['force_optimal_fraction'])} |"
            f" {m['position_sse_ratio_mean']:.3f} | {m['position_sse_ratio_p95']:.3f} | {percent(m['jump_fraction'])} |"
        )
    for p in recording["peers"]:
        if "both_us_p50" not in p:
            continue
        net = p["both_us_p50"] - sum(p["overhead_us"].values())
        rows.append(
            f"| {p['name']} | {p['both_us_p50']:.0f} | {p['both_us_p99']:.0f} | {p['both_us_p50'] / own:.0f} | {net:.0f} ({net / own:.0f} times) |"
            f" {p['force_sse_ratio_p50']:.3f} | {p['force_sse_ratio_mean']:.3g} | {p['force_sse_ratio_p95']:.3g} | {percent(p['force_optimal_fraction'])} |"
            f" {p['position_sse_ratio_mean']:.3f} | {p['position_sse_ratio_p95']:.3f} | {percent(p['jump_fraction'])} |"
        )
    return rows


def kernel_table(recording):
    rows = ["| one-dimensional kernel | us p50 | p99 | times Kmeans1d's | error over the least, max |", "|---|---|---|---|---|"]
    kernels = recording["kernels"]
    own = kernels["Kmeans1d, after the last frame"]["p50_us"]
    for name, times in kernels.items():
        if isinstance(times, dict):
            worst = number(kernels["ckmeans_error_ratio_max"], ".9f") if name.startswith("ckmeans") else ""
            rows.append(f"| {name} | {times['p50_us']:.2f} | {times['p99_us']:.2f} | {times['p50_us'] / own:.1f} | {worst} |")
    for p in recording["peers"]:
        if "both_us_p50" in p:
            continue
        net = p["levels_us_p50"] - p["overhead_us"]["levels"]
        rows.append(
            f"| {p['name']} | {p['levels_us_p50']:.1f} (less overhead {net:.1f}) | {p['levels_us_p99']:.1f} | {p['levels_us_p50'] / own:.1f} ({net / own:.1f}) |"
            f" {p['force_sse_ratio_p95']:.9f} (p95) |"
        )
    return rows


def summary(recordings):
    """The method optimal on every recording."""
    rows = [
        "| recording | contacts | tick us p50 | p99 | p99.9 | every tick p99.9 | frames optimal | position SSE mean | p95 | jumps | in 7 % | centre of pressure | kbit/s | allocations |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for recording in recordings:
        e = recording["eval"]
        m = next(m for m in e["methods"] if m["name"] == "optimal")
        place = [f"{m[key]:.3f}" if m["position_frames"] else "none" for key in ("position_sse_ratio_mean", "position_sse_ratio_p95")]
        rows.append(
            f"| {recording['name']} | {e['contacts_median']:.0f} | {m['tick_us_p50']:.1f} | {m['tick_us_p99']:.1f} | {m['tick_us_p999']:.1f} |"
            f" {m['every_tick_us']['p999']:.0f} | {percent(m['force_optimal_fraction'])} | {place[0]} | {place[1]} | {percent(m['jump_fraction'])} |"
            f" {percent(m['weber_share'])} | {m['cop_error_mean']:.1f} {m['cop_unit']} | {m['bits_per_s'] / 1e3:.1f} | {m['allocations_per_tick']:g} |"
        )
    return "\n".join(rows)


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
        contacts = report["contacts_median"]
        text = [
            f"\n### {name}\n",
            f"{report['frames']} frames of {report['taxels']} taxels, {report['contact_frames']} with contact, median {contacts:.0f} contacts;"
            f" K_D = {LEVELS}, K_A = {ACTUATORS}.\n",
            *table_of(recording),
        ]
        if kernels.get("frames"):
            text += ["", *kernel_table(recording)]
        recording["report"] = "\n".join(text)
        print(recording["report"], flush=True)

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
    (options.out / "results.json").write_text(json.dumps(results, indent=1))
    (options.out / "report.md").write_text("\n".join([results["machine"], "", summary(results["recordings"]), *(r["report"] for r in results["recordings"])]) + "\n")
    print(f"\n{summary(results['recordings'])}")
    print(f"\n{options.out / 'results.json'} and report.md written", file=sys.stderr)


if __name__ == "__main__":
    main()
