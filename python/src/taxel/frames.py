"""Tactile frames that `taxel convert` wrote to a file."""

import os
import re
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import numpy as np

from .arguments import Path
from .files import arrays_of

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Frames:
    """What every taxel read, one frame after another."""

    counts: "NDArray[np.uint16]"
    """T x N x 3: x, y and z of each taxel, in the layout's order; those of an image row by row."""
    t_ns: "NDArray[np.uint64]"
    """Nanoseconds: of an .mcap from its first frame, of CAN traffic from its first CAN frame; those of other files as
    they were there."""
    joints: "NDArray[np.float32]"
    """T x J, radians; J is 0 where none were recorded."""
    without_value: "NDArray[np.bool_]"
    """T x N: true where a taxel had no value of the frame's time. Its counts are then 0."""

    def __len__(self) -> int:
        return len(self.t_ns)


def load_frames(path: Path) -> Frames:
    """Reads the frames of a .npz or .csv of `taxel convert`, also a .csv that a table program saved anew: with a byte order
    mark, names or all cells in quotes, times as 0.0.

    Raises OSError, and ValueError with the file for what is no such file.
    """
    name = os.fsdecode(path)
    readers = {".npz": _npz, ".csv": _csv}
    suffix = FilePath(name).suffix.lower()
    reader = readers.get(suffix)
    if reader is None:
        advice = f"; `taxel convert {name} OUT.npz` makes one" if suffix in (".mcap", ".log", ".npy") else ""
        raise ValueError(f"{name}: frames are read from .npz and .csv{advice}")
    with open(name, "rb") as file:
        try:
            return reader(file)
        except Exception as error:  # numpy, zipfile and zlib have a dozen kinds for what is damaged
            raise ValueError(f"{name}: no frames as `taxel convert` writes them: {error}") from None


def _npz(file: Any) -> Frames:
    with arrays_of(file) as arrays:
        counts, t_ns = arrays["counts"], arrays["t_ns"]
        if counts.ndim == 4:  # frames that are images
            frames, height, width, axes = counts.shape
            counts = counts.reshape(frames, height * width, axes)
        joints = arrays["joints"] if "joints" in arrays else np.zeros((len(t_ns), 0), np.float32)
        without = arrays["without_value"] if "without_value" in arrays else np.zeros(counts.shape[:2], np.bool_)
    if not len(counts) == len(t_ns) == len(joints) or counts.shape[2:] != (3,) or joints.ndim != 2:
        raise ValueError(f"counts of shape {counts.shape}, {len(t_ns)} times, joints of shape {joints.shape}")
    if without.shape != counts.shape[:2]:
        raise ValueError(f"counts of shape {counts.shape}, without_value of shape {without.shape}")
    return Frames(counts, t_ns, joints, without != 0)


_QUOTED_CELL = re.compile(rb'"([^",]*)"')


_EMPTY_CELL = re.compile(rb",(?=[,\r\n]|$)")


_NO_FRACTION = re.compile(rb"\.0*$")


def _time(cell: bytes) -> int:
    return int(_NO_FRACTION.sub(b"", cell.strip().strip(b'"')))


def _csv(file: Any) -> Frames:
    names = file.readline().decode("utf-8-sig").replace('"', "").strip().split(",")
    joints = sum(re.fullmatch(r"J\d+", name) is not None for name in names)
    readings = names[1 : len(names) - joints]
    axes = [name[-1:] for name in readings]
    if names[0] != "t_ns" or not axes or axes != [*"XYZ"] * (len(axes) // 3):
        raise ValueError("its columns are not t_ns, then X, Y and Z of every taxel, then angles")
    begin = file.tell()
    # Not by loadtxt: a float has not all digits of a nanosecond.
    t_ns = np.array([_time(line.split(b",", 1)[0]) for line in file if line.strip()], np.uint64)

    def columns(first: int, count: int) -> Any:
        if count == 0 or len(t_ns) == 0:
            return np.zeros((len(t_ns), count), np.float32)
        file.seek(begin)
        lines = (_EMPTY_CELL.sub(b",nan", _QUOTED_CELL.sub(rb"\1", line)) for line in file)
        return np.loadtxt(lines, np.float32, delimiter=",", usecols=range(first, first + count), ndmin=2)

    values = columns(1, len(readings)).reshape(len(t_ns), len(readings) // 3, 3)
    without = np.isnan(values).all(axis=2)
    values[without] = 0
    strange = ~((values >= 0) & (values <= 65535) & (values % 1 == 0))
    if strange.any():
        frame, taxel, axis = np.argwhere(strange)[0]
        raise ValueError(
            f"frame {frame}, column {names[1 + 3 * taxel + axis]} is {values[frame, taxel, axis]}; a count is a whole "
            "number from 0 to 65535, and a taxel without a value has none on all three axes"
        )
    return Frames(values.astype(np.uint16), t_ns, columns(1 + len(readings), joints), without)
