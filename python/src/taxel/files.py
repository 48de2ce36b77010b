"""Images that `taxel compress` or `taxel watch --json` wrote to a file."""

import json
import os
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, Iterator, List, Optional

import numpy as np

from . import _reader, messages
from .arguments import Path

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Images:
    """Images one after another; `len`, an index and iterating give each as an `Image`."""

    pixels: "NDArray[np.uint8]"
    """T x height x width."""
    seq: "NDArray[np.uint64]"
    t_ns: "NDArray[np.uint64]"
    contacts: "NDArray[np.uint32]"
    faulty: "NDArray[np.uint32]"
    missing: "NDArray[np.uint32]"
    joints: "NDArray[np.float32]"
    """T x J, radians; J is 0 where none were recorded."""
    levels: "NDArray[np.float64]"
    """T x L; not a number behind the last level of an image."""
    actuators: List["messages.Records"]
    """Of each image those that press."""

    def __len__(self) -> int:
        return len(self.seq)

    def __getitem__(self, index: int) -> messages.Image:
        levels = self.levels[index]
        return messages.Image(
            seq=int(self.seq[index]),
            t_ns=int(self.t_ns[index]),
            pixels=self.pixels[index],
            levels=levels[~np.isnan(levels)],
            actuators=self.actuators[index],
            joints=self.joints[index],
            contacts=int(self.contacts[index]),
            faulty=int(self.faulty[index]),
            missing=int(self.missing[index]),
        )

    def __iter__(self) -> Iterator[messages.Image]:
        return (self[index] for index in range(len(self)))


def load(path: Path) -> Images:
    """Reads a .npz or .bin of `taxel compress`, or a .jsonl of `taxel compress` or `taxel watch --json`.

    Raises OSError, and ValueError with the file (and the line) for what is no such file.
    """
    name = os.fsdecode(path)
    readers = {".npz": _npz, ".jsonl": _jsonl, ".bin": _bin}
    reader = readers.get(FilePath(name).suffix.lower())
    if reader is None:
        raise ValueError(f"{name}: images are read from .npz, .jsonl and .bin")
    return reader(name)


def _npz(name: str) -> Images:
    with np.load(name) as file:
        absent = [key for key in ("images", "levels", "actuators", "seq", "t_ns") if key not in file]
        if absent:
            raise ValueError(f"{name} has no array {absent[0]!r}; is it a .npz that `taxel compress` wrote?")
        frames = len(file["seq"])
        rows = file["actuators"]
        return Images(
            pixels=file["images"],
            seq=file["seq"],
            t_ns=file["t_ns"],
            contacts=file["contacts"].astype(np.uint32),
            faulty=file["faulty"].astype(np.uint32),
            missing=file["missing"].astype(np.uint32),
            joints=file["joints"] if "joints" in file else np.zeros((frames, 0), np.float32),
            levels=file["levels"],
            actuators=[messages.actuators(row[~np.isnan(row[:, 0])]) for row in rows],
        )


def _jsonl(name: str) -> Images:
    images = []
    with open(name, encoding="utf-8") as file:
        for number, line in enumerate(file, 1):
            if not line.strip():
                continue
            try:
                images.append(_of_object(json.loads(line)))
            except (ValueError, KeyError, TypeError) as error:
                raise ValueError(f"{name}:{number}: no image as `taxel watch --json` prints one: {error!r}") from None
    return _stack(images)


def _of_object(value: Any) -> messages.Image:
    shape = (int(value["height"]), int(value["width"]))
    rows = [(a["id"], a["x"], a["y"], a["level"], a["force"]) for a in value["actuators"]]
    angles: List[Optional[float]] = value["joints"]
    return messages.Image(
        seq=int(value["seq"]),
        t_ns=int(value["t_ns"]),
        pixels=np.array(value["image"], np.uint8).reshape(shape),
        levels=np.array(value["levels"], np.float64),
        actuators=messages.actuators(rows),
        joints=np.array([np.nan if angle is None else angle for angle in angles], np.float32),
        contacts=int(value["contacts"]),
        faulty=int(value["faulty"]),
        missing=int(value["missing"]),
    )


def _bin(name: str) -> Images:
    data = memoryview(FilePath(name).read_bytes())
    images, at = [], 0
    while at < len(data):
        try:
            message, length = _reader.decode(data[at:])
        except _reader.DecodeError as error:
            raise ValueError(f"{name}: byte {at}: {error}") from None
        image = messages.of_reader(message)
        if isinstance(image, messages.Image):
            images.append(image)
        at += length
    return _stack(images)


def _stack(images: List[messages.Image]) -> Images:
    first = images[0] if images else None
    most = max((len(image.levels) for image in images), default=0)
    levels = np.full((len(images), most), np.nan)
    for row, image in zip(levels, images):
        row[: len(image.levels)] = image.levels
    shape = first.pixels.shape if first else (0, 0)
    joints = len(first.joints) if first else 0

    def column(key: str, kind: Any) -> Any:
        return np.array([getattr(image, key) for image in images], kind)

    return Images(
        pixels=column("pixels", np.uint8).reshape(len(images), *shape),
        seq=column("seq", np.uint64),
        t_ns=column("t_ns", np.uint64),
        contacts=column("contacts", np.uint32),
        faulty=column("faulty", np.uint32),
        missing=column("missing", np.uint32),
        joints=column("joints", np.float32).reshape(len(images), joints),
        levels=levels,
        actuators=[image.actuators for image in images],
    )
