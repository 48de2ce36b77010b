"""`optimal` on contacts that it was not tuned on: made-up things that press, grow, slide and let go within seconds.

    cargo build --release
    tests/.cache/venv/bin/python tests/peers/made_up.py [--restarts 4000] [--taxel target/release/taxel] [--keep DIR]

Balls, edges and flat punches under a soft skin, with the pressures of Hertz and of a rigid punch (Johnson, Contact
Mechanics, 1985, chapters 3, 4 and 2), blurred by 0.8 of a taxel, with noise of one count in 300. It says nothing of a
real skin. Then blocks that go on by a pixel a frame, large discs by less, and things that turn or roll in every frame.
Prints tables in Markdown: each skin's contacts, and of `optimal` what docs/benchmarks.md sets as goals. Last, two even
forces side by side, and the same turned by 90 degrees (--only-even prints that table alone).
"""

import tempfile
from pathlib import Path

import numpy as np
from judged import command_line, head, judged, line, percent, places

SCALE, NOISE, BLUR = 300.0, 1.0, 0.8
# Name, rows x columns, frames at 30 Hz, things, their radii in taxels, pixels that one slides in a frame (one sigma).
SKINS = [
    ("8 x 8", 90, 3, (1, 3), 0.02), ("14 x 7", 90, 3, (1.5, 3), 0.02), ("15 x 16", 90, 5, (2, 4), 0.02),
    ("16 x 16", 90, 7, (2, 6), 0.01), ("16 x 16", 90, 3, (4, 9), 0.03), ("20 x 12", 90, 6, (1.5, 4), 0.02),
    ("10 x 24", 90, 9, (1, 2.5), 0.005), ("32 x 32", 60, 5, (3, 9), 0.02), ("50 x 28", 60, 6, (3, 9), 0.02),
    ("50 x 28", 300, 6, (3, 9), 0.004),
]  # fmt: skip
# Rows x columns of a block, on a skin of 28 x 28.
BLOCKS = [(4, 4), (4, 5), (3, 6), (5, 6), (1, 17)]
# Rows x columns of a skin, radius of a disc on it, pixels that it goes on in a frame.
DISCS = [(37, 38, 12, 0.3), (64, 64, 18, 0.5)]

# Rows x columns of a contact, columns of it that are pressed with the first force and not the second, the two.
EVEN = [(6, 8, 4, 300, 40), (6, 7, 3, 300, 60), (6, 6, 3, 200, 100), (7, 5, 3, 300, 100), (8, 7, 4, 600, 60)]

# What turns or rolls, rows x columns, kind of thing, its radius.
TURNS = [("edge that turns", 20, 20, 1, 4), ("square that turns", 20, 20, 2, 6), ("ball that rolls", 20, 32, 0, 4.5)]


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


def block(rows: int, columns: int) -> np.ndarray:
    """A block of forces that goes to and fro, by a pixel to the side and one up or down in turns."""
    force = np.random.default_rng(5).uniform(100, 1000, (rows, columns))
    felt = np.zeros((120, 28, 28))
    for t in range(120):
        left, top = (abs((n + room) % (2 * room) - room) for n, room in ((t // 2 + t % 2, 28 - columns), (t // 2, 28 - rows)))
        felt[t, top : top + rows, left : left + columns] = force
    return np.round(felt).astype(np.uint16)


def disc(rows: int, columns: int, radius: float, by: float) -> np.ndarray:
    """A round contact that goes on steadily, up and across."""
    y, x = np.mgrid[:rows, :columns].astype(float)
    felt = []
    for t in range(int(min(120, (columns - 2 * radius) / by))):
        away = ((x - radius - by * t) ** 2 + (y - radius - 0.4 * by * t) ** 2) / radius**2
        felt.append(np.where(away < 1, 100 + 1000 * np.sqrt(np.clip(1 - away, 0, None)), 0))
    return np.round(felt).astype(np.uint16)


def turning(rows: int, columns: int, kind: int, radius: float) -> np.ndarray:
    """An edge, harder at one end, or a square punch turns about its middle; a ball is rolled about under more and less force."""
    random = np.random.default_rng(kind)
    y, x = np.mgrid[:rows, :columns].astype(float)
    middle, felt = ((rows - 1) / 2, (columns - 1) / 2), []
    for t in range(150):
        round_, angle = 2 * np.pi * t / 150, 0.06 * t
        share, way = (0.6 + 0.3 * np.sin(3 * round_), 1) if kind == 0 else (0.9, 0)
        cy = middle[0] + way * (middle[0] - radius - 1) * np.sin(2 * round_)
        cx = middle[1] - way * (middle[1] - radius - 1) * np.cos(round_)
        u = (x - cx) * np.cos(angle) + (y - cy) * np.sin(angle)
        v = (y - cy) * np.cos(angle) - (x - cx) * np.sin(angle)
        press = share * pressure(kind, u, v, radius * share ** (1 / 3), 1)
        if kind == 1:
            press *= 0.55 + 0.05 * u
        felt.append(np.clip(blurred(SCALE * press) + random.normal(0, NOISE, (rows, columns)), 0, None))
    return np.round(8 * np.array(felt)).astype(np.uint16)


def even(rows: int, columns: int, hard_columns: int, hard: float, soft: float) -> np.ndarray:
    """Two even forces side by side, with a noise of 3, on a skin of 12 x 12."""
    felt = np.zeros((30, 12, 12))
    force = np.where(np.arange(columns) < hard_columns, hard, soft)
    felt[:, 2 : 2 + rows, 2 : 2 + columns] = force + np.random.default_rng(2).normal(0, 3, (30, rows, columns))
    return np.round(8 * felt).astype(np.uint16)


def print_even(args, folder: Path) -> None:
    head("contact", "`optimal` NRMSE shown", "turned", "with `force_distance` 0", "turned", "`paper`", "turned")
    for contact in EVEN:
        rows, columns, hard_columns, hard, soft = contact
        shown = []
        for felt in (even(*contact), even(*contact).transpose(0, 2, 1)):
            np.save(folder / "even.npy", np.ascontiguousarray(felt))
            methods = ["optimal", "optimal force_distance=0", "paper"]
            report = judged(args, methods, str(folder / "even.npy"), "--threshold", "80", "--release", "40")
            shown.append([f"{method['displayed_nrmse']:.4f}" for method in report["methods"]])
        name = f"{rows} x {columns}, {hard_columns} columns at {hard}, the others at {soft}"
        line(name, *(error for pair in zip(*shown) for error in pair))


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--only-even", action="store_true", help="the last table alone")
    parser.add_argument("--keep", type=Path, help="a folder for the recordings, as .npy")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as made:
        folder = args.keep or Path(made)
        if args.only_even:
            print_even(args, folder)
            return

        def judge(name: str, path: Path, felt: np.ndarray) -> None:
            np.save(path, felt)
            report = judged(args, ["paper", "optimal"], str(path), "--threshold", "80", "--release", "40")
            paper, optimal = report["methods"]
            shown, bound = optimal["displayed_nrmse"], percent(report["jump_bound_fraction"])
            line(
                name, f"{len(felt) / 30:.0f}", f"{report['contacts_median']:.0f}", bound, *places(optimal),
                percent(optimal["jump_fraction"]), f"{shown:.3f}", f"{shown / paper['displayed_nrmse']:.2f}",
            )  # fmt: skip

        figures = ["seconds", "contacts", "least jumps", "position SSE mean", "p95", "jumps", "NRMSE shown", "of `paper`'s"]
        head("skin", *figures)
        for seed, (size, frames, things, radii, slide) in enumerate(SKINS, 1):
            rows, columns = map(int, size.split(" x "))
            felt = recording(rows, columns, frames, things, radii, slide, seed)
            judge(size, folder / f"{seed:02}-{rows}x{columns}.npy", felt)
        print()
        head("what moves", *figures)
        for rows, columns in BLOCKS:
            judge(f"block of {rows} x {columns}", folder / f"block-{rows}x{columns}.npy", block(rows, columns))
        for rows, columns, radius, by in DISCS:
            path = folder / f"disc-{rows}x{columns}.npy"
            judge(f"disc of radius {radius} on {rows} x {columns}", path, disc(rows, columns, radius, by))
        for name, rows, columns, kind, radius in TURNS:
            judge(name, folder / f"{name.replace(' ', '-')}.npy", turning(rows, columns, kind, radius))
        print()
        print_even(args, folder)


if __name__ == "__main__":
    main()
