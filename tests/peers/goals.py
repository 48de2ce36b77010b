"""`optimal` on every scene and grasp there is, against the goals of docs/benchmarks.md.

    cargo build --release
    tests/.cache/venv/bin/python tests/peers/goals.py [--restarts 4000] [--taxel target/release/taxel] [--data DIR]

The twenty simple objects that `taxel sim --list` has, and the scenes that no other table has; with --data, each grasp of
schunk_sdh_grasps.npz above thresholds of 10 and 20 that has more contacts than actuators in 20 frames or more. Prints
tables in Markdown.
"""

import json
import subprocess
from pathlib import Path

import numpy as np
from judged import command_line, head, judged, line, percent, places

SCENES = ["roll", "faulty-hand"]
FEWEST_FRAMES = 20
METHODS = ["paper", "optimal", "optimal force_distance=0"]
FIGURES = ["contacts", "position SSE mean", "p95", "jumps", "NRMSE shown", "with `force_distance` 0", "of `paper`'s", "with `force_distance` 0"]


def print_row(name: str, report: dict) -> None:
    paper, optimal, places_alone = report["methods"]
    shown = [m["displayed_nrmse"] for m in (optimal, places_alone)]
    errors = [f"{s:.3f}" for s in shown] + [f"{s / paper['displayed_nrmse']:.2f}" for s in shown]
    line(name, f"{report['contacts_median']:.0f}", *places(optimal), percent(optimal["jump_fraction"]), *errors)


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--data", type=Path, help="the folder of schunk_sdh_grasps.npz")
    args = parser.parse_args()
    listed = subprocess.run([args.taxel, "sim", "--list", "--json"], check=True, stdout=subprocess.PIPE)
    objects = [scene["name"] for scene in json.loads(listed.stdout) if scene["about"].startswith("Grasps and lets go")]
    head("scene", *FIGURES)
    for name in [*SCENES, *objects]:
        print_row(name, judged(args, METHODS, f"sim:{name}"))
    if not args.data:
        return
    path = args.data / "schunk_sdh_grasps.npz"
    print()
    head("grasp above a threshold", *FIGURES)
    for grasp in np.load(path).files:
        for threshold in ("10", "20"):
            where = ("--array", grasp, "--layout", "schunk-sdh", "--idle", "10", "--rate", "15", "--threshold", threshold)
            report = judged(args, METHODS, str(path), *where)
            if report and report["methods"][1]["position_frames"] >= FEWEST_FRAMES:
                print_row(f"{grasp}, {threshold}", report)


if __name__ == "__main__":
    main()
