"""The recordings of one module, spread over the whole hand. They are not part of the repository."""

import os
from pathlib import Path

import numpy as np
import pytest

FOLDER = Path(os.environ.get("TAXEL_DATA", Path(__file__).resolve().parents[3] / "shared/data"))


def module_counts(file, array):
    """One module's counts, (T, 16, 3) in the order of the taxels' numbers; skips the test where there are none."""
    path = FOLDER / file
    if not path.exists():
        pytest.skip(f"{path} is not there (set TAXEL_DATA)")
    with np.load(path) as arrays:
        columns = arrays[array].astype(np.int64)
    if file == "uskin_pick_and_move.npz":  # 16 x, then 16 y, then 16 z
        return columns.reshape(-1, 3, 16).transpose(0, 2, 1)
    return columns.reshape(-1, 16, 3)  # x1 y1 z1 x2 ...


def tiled(module, hand, lag=3):
    """The module on every board of the hand, each `lag` frames after the one before, so that no two are alike."""
    modules = len(hand) // 16
    frames = np.arange(len(module) - lag * (modules - 1))
    return np.concatenate([module[frames + lag * m] for m in range(modules)], axis=1)
