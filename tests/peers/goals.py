"""`optimal` on every scene and grasp there is, against the goals of docs/benchmarks.md.

    cargo build --release
    tests/.cache/venv/bin/python tests/peers/goals.py [--restarts 4000] [--taxel target/release/taxel] [--data DIR]

The twenty simple objects that `taxel sim --list` has, and the scenes that no other table has; with --data, each grasp of
schunk_sdh_grasps.npz above thresholds of 10 and 20 that has more contacts than actuators in 20 frames or more. Prints
tables in Markdown.
"""

import argparse
import json
import subprocess
from pathlib import Path

import numpy as np

SCENES = ["roll", "faulty-hand"]
FEWEST_FRAMES = 20


def judged(taxel: str, restarts: str, *what: str) -> dict | None:
    """The report of `taxel eval`; None where it refuses the input, as one without a contact."""
    command = [taxel, "eval", *what, "--restarts", restarts, "--passes", "1", "--json"]
    command += [word for method in ("paper", "optimal", "optimal force_distance=0") for word in ("--method", method)]
    ended = subprocess.run(command, stdout=subprocess.PIPE)
    return json.loads(ended.stdout) if ended.returncode == 0 else None


def print_row(name: str, report: dict) -> None:
    paper, optimal, places_alone = report["methods"]
    ratios = [optimal[f"position_sse_ratio_{of}"] for of in ("mean", "p95")]
    shown = [m["displayed_nrmse"] for m in (optimal, places_alone)]
    cells = [name, f"{report['contacts_median']:.0f}", *("none" if r is None else f"{r:.3f}" for r in ratios)]
    cells += [f"{100 * optimal['jump_fraction']:.1f} %", *(f"{s:.3f}" for s in shown)]
    cells += [f"{s / paper['displayed_nrmse']:.2f}" for s in shown]
    print(f"| {' | '.join(cells)} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--restarts", default="4000")
    parser.add_argument("--taxel", default="target/release/taxel")
    parser.add_argument("--data", type=Path, help="the folder of schunk_sdh_grasps.npz")
    args = parser.parse_args()
    head = "contacts | position SSE mean | p95 | jumps | NRMSE shown | with `force_distance` 0 | of `paper`'s | with `force_distance` 0 |"
    listed = subprocess.run([args.taxel, "sim", "--list", "--json"], check=True, stdout=subprocess.PIPE)
    objects = [scene["name"] for scene in json.loads(listed.stdout) if scene["about"].startswith("Grasps and lets go")]
    print(f"| scene | {head}\n|---|---|---|---|---|---|---|---|---|")
    for name in [*SCENES, *objects]:
        print_row(name, judged(args.taxel, args.restarts, f"sim:{name}"))
    if not args.data:
        return
    path = args.data / "schunk_sdh_grasps.npz"
    print(f"\n| grasp above a threshold | {head}\n|---|---|---|---|---|---|---|---|---|")
    for grasp in np.load(path).files:
        for threshold in ("10", "20"):
            where = ("--array", grasp, "--layout", "schunk-sdh", "--idle", "10", "--rate", "15", "--threshold", threshold)
            report = judged(args.taxel, args.restarts, str(path), *where)
            if report and report["methods"][1]["position_frames"] >= FEWEST_FRAMES:
                print_row(f"{grasp}, {threshold}", report)


if __name__ == "__main__":
    main()
