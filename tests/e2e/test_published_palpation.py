"""`examples/palpation/published.py`: the authors' measurements as a sweep, judged as their own program judges them."""

import csv
import importlib.util
import subprocess
from pathlib import Path

import numpy as np
import pytest
from harness.daemon import binary

ROOT = Path(__file__).parents[2]
WINDOW = 13
TAXELS = 7


@pytest.fixture(scope="module")
def published():
    spec = importlib.util.spec_from_file_location("published", ROOT / "examples/palpation/published.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def measured(classes, rng):
    """Arrays as the authors' files have them: 16 areas that differ by what lies under them, and by chance."""
    arrays = {"nodules": np.zeros((4, 4, 4))}
    shapes = {label: rng.normal(size=TAXELS) for label in sorted(set(classes))}
    for area, label in enumerate(classes):
        place = f"{area // 4 + 1}_{area % 4 + 1}"
        depths, angles = np.arange(0, 20.5, 0.5), np.arange(30, -31, -1.0)
        for name, at, depth in (
            (f"Vertical_{place}", depths, depths),
            (f"Rotate_{place}_d150_r100", angles, 15 + 0.05 * angles),
        ):
            level = 15000 * (1 - np.exp(-depth / 6))[:, None, None] * (1 + 0.05 * shapes[label])[:, None]
            values = 10000 + level + rng.normal(scale=400, size=(len(at), TAXELS, 3))
            arrays[name] = np.concatenate([np.broadcast_to(at[:, None, None], (len(at), 1, 3)), values], axis=1)
    return arrays


def of_the_classes(touches, classes):
    """Silhouette of the true classes on the first two principal components, touch by touch; one alone counts 0."""
    centred = touches - touches.mean(axis=0)
    u, s, _ = np.linalg.svd(centred, full_matrices=False)
    places = u[:, :2] * s[:2]
    distance = np.linalg.norm(places[:, None] - places, axis=2)
    classes = np.array(classes)
    values = []
    for n, own in enumerate(classes):
        mean = {label: distance[n, classes == label].sum() for label in set(classes)}
        members = (classes == own).sum()
        if members == 1:
            values.append(0.0)
            continue
        a = mean[own] / (members - 1)
        b = min(mean[label] / (classes == label).sum() for label in set(classes) - {own})
        values.append((b - a) / max(a, b))
    return np.mean(values)


def test_a_sweep_of_the_published_measurements_is_judged_as_by_their_authors(published, tmp_path):
    rng = np.random.default_rng(7)
    classes = {phantom: text.split() for phantom, (_, text) in published.PHANTOMS.items()}
    phantoms = {phantom: measured(classes[phantom], rng) for phantom in classes}
    published.write(tmp_path, phantoms)
    command = [binary("taxel"), "categorize", "--sweep", "sweep.csv", "--window", "6.5", "--figures", "."]
    made = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert made.returncode == 0, made.stderr
    with open(tmp_path / "sweep.csv") as file:
        rows = [row for row in csv.DictReader(file) if row["clusters"] == "5"]
    assert len(rows) == 2 * (14 + 1)
    for row in rows:
        arrays = phantoms[row["phantom"]]
        is_rotary = float(row["radius_mm"]) > 0
        # The authors' windows: frames i - 13 to i - 1, i being that of the depth.
        end = round(2 * float(row["depth_mm"]))
        frames = slice(None) if is_rotary else slice(end - WINDOW, end)
        names = [name for name in arrays if name.startswith("Rotate" if is_rotary else "Vertical")]
        touches = np.array([arrays[name][frames, 1:].mean(axis=2).reshape(-1) for name in names])
        assert int(row["features"]) == touches.shape[1] == TAXELS * (61 if is_rotary else WINDOW)
        expected = of_the_classes(touches, classes[row["phantom"]])
        assert float(row["silhouette_classes"]) == pytest.approx(expected, rel=1e-9, abs=1e-12), row
