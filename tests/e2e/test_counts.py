"""Counts of a skin without buses: every image of the method `paper` is that of the numpy reference, whatever file they come in,
and that of `optimal` where counts do not change at rest."""

import json
import subprocess

import numpy as np
import pytest
import taxel_reader
from harness.compare import Reference, assert_same
from harness.compare_optimal import Frame
from harness.daemon import binary
from robust_conditioning import SETTINGS, RobustConditioner
from sequential_clustering import Profile

PERIOD_NS = 33_333_333


class Grid:
    """A skin of which the harness needs places alone."""

    def __init__(self, height, width):
        self.shape = (height, width)
        self.xy = np.array([(x, y) for y in range(height) for x in range(width)])

    def __len__(self):
        return len(self.xy)


def touches(grid, frames, seed):
    """Counts at offsets of their own; from the fifth frame on a press that wanders, and taxels without a value now and then."""
    random = np.random.default_rng(seed)
    counts = random.integers(8_000, 40_000, (len(grid), 3)) + random.integers(-3, 4, (frames, len(grid), 3))
    for t in range(4, frames):
        centre = random.uniform((0, 0), grid.shape[::-1])
        press = 2000 * np.exp(-np.sum((grid.xy - centre) ** 2, axis=1) / 12)
        counts[t, :, 2] += press.astype(int)
    missing = random.random((frames, len(grid))) < 0.02
    missing[:4] = False
    missing[0, -1] = True  # s_0 waits for it
    return counts, missing


def files(folder, grid, counts, missing, begins_ns):
    """The same recording in each form that has room for missing taxels."""
    values = np.where(missing[..., None], np.nan, counts)
    times = begins_ns + PERIOD_NS * np.arange(len(counts), dtype=np.uint64)
    np.savez(folder / "flat.npz", counts=values.astype(np.float32), t_ns=times)
    np.savez(folder / "image.npz", counts=values.reshape(-1, *grid.shape, 3), t_ns=times)
    names = ",".join(f"0B{n}{axis}" for n in range(len(grid)) for axis in "XYZ")
    rows = [",".join("" if np.isnan(v) else str(int(v)) for v in frame.ravel()) for frame in values]
    lines = [f"t_ns,{names}", *(f"{t},{row}" for t, row in zip(times, rows))]
    (folder / "frames.csv").write_text("\n".join(lines) + "\n")
    return times, ["flat.npz", "image.npz", "frames.csv"]


def images(folder, name, grid, *more):
    out = folder / f"{name}.bin"
    layout = "grid:{}x{}".format(*grid.shape)
    command = [binary("taxel"), "compress", folder / name, "--layout", layout, "--method", "paper", "--out", out, *more]
    subprocess.run(command, check=True, capture_output=True)
    data = out.read_bytes()
    while data:
        message, length = taxel_reader.decode(data)
        yield message
        data = data[length:]


@pytest.mark.parametrize("shape, actuators", [((3, 5), 4), ((16, 16), 16), ((1, 40), 16)])
def test_counts_on_a_grid_are_the_references_images_from_every_file(folder, shape, actuators):
    grid = Grid(*shape)
    counts, missing = touches(grid, frames=40, seed=shape[0])
    times, names = files(folder, grid, counts, missing, begins_ns=266_594_555)
    for name in names:
        reference, touched = Reference(grid, Profile(actuators=actuators)), 0
        got = list(images(folder, name, grid, "--actuators", str(actuators)))
        assert [image.t_ns for image in got] == times.tolist(), name
        for t, image in enumerate(got):
            assert_same(image, reference.image(counts[t], missing[t]), f"{name}, frame {t}")
            touched += image.contacts > 0
        assert touched > 30, name


@pytest.mark.parametrize(
    "noise, step",
    [(0.0, 1), (0.2, 1), (0.3, 16)],
    ids=["no noise", "noise below half a count", "noise below half a step of 16 counts"],
)
def test_a_skin_that_hardly_changes_at_rest_is_felt_from_the_first_frame_of_a_touch_to_its_last(folder, noise, step):
    grid, random = Grid(8, 8), np.random.default_rng(3)
    pressed = np.hypot(*(grid.xy - (3.4, 4.1)).T)
    # Rest, a press that grows for two seconds, is held, and ends; then rest.
    depth = np.concatenate([np.zeros(60), np.linspace(0, 1, 60), np.ones(30), np.linspace(1, 0, 60), np.zeros(90)])
    counts = np.full((len(depth), 64, 3), 20_000)
    force = 1000 * depth[:, None] * np.clip(1 - (pressed / 3) ** 2, 0, None)
    counts[..., 2] += step * np.round(force / step).astype(int)
    counts += step * np.round(random.normal(0, noise, counts.shape)).astype(int)
    times = PERIOD_NS * np.arange(1, len(counts) + 1)
    np.savez(folder / "quiet.npz", counts=counts.astype(np.uint16), t_ns=times.astype(np.uint64))
    keys = "\n".join(f"{key} = {json.dumps(value)}" for key, value in SETTINGS.items())
    (folder / "c.toml").write_text(f'layout = "grid:8x8"\n[conditioning]\n{keys}\n')

    out = folder / "quiet.bin"
    command = [binary("taxel"), "compress", folder / "quiet.npz", "--config", folder / "c.toml", "--out", out]
    subprocess.run(command, check=True, capture_output=True)
    conditioner, profile = RobustConditioner(64), Profile(actuator_force="closest")
    data, touched = out.read_bytes(), []
    for t in range(len(counts)):
        image, length = taxel_reader.decode(data)
        data = data[length:]
        felt = conditioner.feed(counts[t], np.full(64, times[t]), times[t])
        assert image.calibrating == (felt is None)
        if felt is not None:
            Frame(grid, profile, *felt).check(image, f"frame {t}")
            touched += [t] * (image.contacts > 0)
    truly = np.flatnonzero(counts[..., 2].max(axis=1) > 20_000 + conditioner.threshold)
    assert abs(touched[0] - truly[0]) <= 1 and abs(touched[-1] - truly[-1]) <= 1 and len(touched) > 140
