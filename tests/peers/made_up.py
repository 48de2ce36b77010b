"""`optimal` on contacts that it was not tuned on: made-up things that press, grow, slide and let go within seconds.

    cargo build --release
    tests/.cache/venv/bin/python tests/peers/made_up.py [--restarts 4000] [--taxel target/release/taxel] [--keep DIR]

Balls, edges and flat punches under a soft skin, with the pressures of Hertz and of a rigid punch (Johnson, Contact
Mechanics, 1985, chapters 3, 4 and 2), blurred by 0.8 of a taxel, with noise of one count in 300. It says nothing of a
real skin. Prints a table in Markdown: each skin's contacts, and of `optimal` what docs/benchmarks.md sets as goals.
"""

import argparse
import json
import subprocess
import tempfile
from pathlib import Path

import numpy as np

SCALE, NOISE, BLUR = 300.0, 1.0, 0.8
# Name, rows x columns, frames at 30 Hz, things, their radii in taxels, pixels that one slides in a frame (one sigma).
SKINS = [
    ("8 x 8", 90, 3, (1, 3), 0.02), ("14 x 7", 90, 3, (1.5, 3), 0.02), ("15 x 16", 90, 5, (2, 4), 0.02),
    ("16 x 16", 90, 7, (2, 6), 0.01), ("16 x 16", 90, 3, (4, 9), 0.03), ("20 x 12", 90, 6, (1.5, 4), 0.02),
    ("10 x 24", 90, 9, (1, 2.5), 0.005), ("32 x 32", 60, 5, (3, 9), 0.02), ("50 x 28", 60, 6, (3, 9), 0.02),
    ("50 x 28", 300, 6, (3, 9), 0.004),
]  # fmt: skip


def pressure(kind: int, u: np.ndarray, v: np.ndarray, radius: float, shape: float) -> np.ndarray:
    """Over the greatest, at places in the thing's own axes."""
    if kind == 0:
        return np.sqrt(np.clip(1 - (u / radius) ** 2 - (v / (radius * shape)) ** 2, 0, None))
    if kind == 1:
        return np.sqrt(np.clip(1 - (2 * v / radius) ** 2, 0, None)) * (np.abs(u) < 1.6 * radius)
    inside = (np.abs(u) < radius) & (np.abs(v) < radius * shape)
    rim = (np.abs(u) > radius - 1) | (np.abs(v) > radius * shape - 1)
    return 0.5 * inside * (1 + 0.8 * rim)


def blurred(frame: np.ndarray) -> np.ndarray:
    kernel = np.exp(-0.5 * (np.arange(-3, 4) / BLUR) ** 2)
    for axis in (0, 1):
        frame = np.apply_along_axis(np.convolve, axis, frame, kernel / kernel.sum(), "same")
    return frame


def recording(rows: int, columns: int, frames: int, things: int, radii, slide: float, seed: int) -> np.ndarray:
    """T x rows x columns magnitudes, eight to the count."""
    random = np.random.default_rng(seed)
    y, x = np.mgrid[:rows, :columns].astype(float)
    drawn = [
        {
            "at": random.random(2) * [rows - 1, columns - 1], "by": random.normal(0, slide, 2),
            "force": random.uniform(0.3, 1) * SCALE, "radius": random.uniform(*radii), "shape": random.uniform(0.5, 1),
            "turn": random.uniform(0, np.pi), "kind": random.integers(0, 3),
            "from": random.uniform(0, 0.25) * frames, "to": random.uniform(0.7, 1.0) * frames,
        }
        for _ in range(things)
    ]  # fmt: skip
    felt = np.zeros((frames, rows, columns))
    for t in range(frames):
        for thing in drawn:
            rise, fall = (t - thing["from"]) / (0.15 * frames), (thing["to"] - t) / (0.12 * frames)
            share = np.clip(rise, 0, 1) * np.clip(fall, 0, 1)
            if share > 0:
                (cy, cx), turn = thing["at"] + thing["by"] * t, thing["turn"]
                u = (x - cx) * np.cos(turn) + (y - cy) * np.sin(turn)
                v = (y - cy) * np.cos(turn) - (x - cx) * np.sin(turn)
                # A contact's radius grows with the third root of its force.
                press = pressure(thing["kind"], u, v, thing["radius"] * share ** (1 / 3), thing["shape"])
                felt[t] = np.maximum(felt[t], thing["force"] * share * press)
        felt[t] = np.clip(blurred(felt[t]) + random.normal(0, NOISE, (rows, columns)), 0, None)
    return np.round(8 * felt).astype(np.uint16)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--restarts", default="4000")
    parser.add_argument("--taxel", default="target/release/taxel")
    parser.add_argument("--keep", type=Path, help="a folder for the recordings, as .npy")
    args = parser.parse_args()
    print("| skin | seconds | contacts | least jumps | position SSE mean | p95 | jumps | NRMSE shown | of `paper`'s |")
    print("|---|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as made:
        for seed, (size, frames, things, radii, slide) in enumerate(SKINS, 1):
            rows, columns = map(int, size.split(" x "))
            path = (args.keep or Path(made)) / f"{seed:02}-{rows}x{columns}.npy"
            np.save(path, recording(rows, columns, frames, things, radii, slide, seed))
            command = [args.taxel, "eval", path, "--threshold", "80", "--release", "40", "--restarts", args.restarts]
            command += ["--method", "paper", "--method", "optimal", "--passes", "1", "--json"]
            report = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)
            paper, optimal = report["methods"]
            shown, bound = optimal["displayed_nrmse"], report["jump_bound_fraction"]
            print(
                f"| {size} | {frames // 30} | {report['contacts_median']:.0f} | {100 * bound:.1f} % "
                f"| {optimal['position_sse_ratio_mean']:.3f} | {optimal['position_sse_ratio_p95']:.3f} "
                f"| {100 * optimal['jump_fraction']:.1f} % | {shown:.3f} | {shown / paper['displayed_nrmse']:.2f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
