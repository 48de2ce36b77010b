"""Images that `taxel compress` or `taxel watch --json` wrote to a file."""

import json
import operator
import os
import warnings
import zipfile
from dataclasses import dataclass, fields
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, Iterable, Iterator, List, Optional, Tuple, Union, overload

import numpy as np

from . import _reader, messages
from .arguments import Path

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Images:
    """Images one after another; an index and iterating give each as an `Image`, a slice several as `Images`."""

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

    @overload
    def __getitem__(self, index: int) -> messages.Image: ...

    @overload
    def __getitem__(self, index: slice) -> "Images": ...

    def __getitem__(self, index: Union[int, slice]) -> Union[messages.Image, "Images"]:
        if isinstance(index, slice):
            return Images(**{field.name: getattr(self, field.name)[index] for field in fields(self)})
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


_DIMENSIONS = {"pixels": 3, "joints": 2, "levels": 2}
"""Of the arrays that have more than one."""


def load(path: Path) -> Images:
    """Reads a .npz or .bin of `taxel compress`, a .npz of `taxel convert --images`, or a .jsonl of `taxel compress` or
    `taxel watch --json`. `load_frames` reads frames.

    A last line of a .jsonl that is torn is left out, with a warning. Raises OSError, and ValueError with the file, and the
    line or byte, for what is no such file.
    """
    name = os.fsdecode(path)
    readers = {".npz": _npz, ".jsonl": _jsonl, ".bin": _bin}
    suffix = FilePath(name).suffix.lower()
    reader = readers.get(suffix)
    if reader is None:
        raise ValueError(f"{name}: images are read from .npz, .jsonl and .bin{_ELSEWHERE.get(suffix, '')}")
    return reader(name)


_ELSEWHERE = {
    ".mcap": "; `taxel convert IN.mcap OUT.npz --images` makes one, and mcap-ros2-support reads every message of an .mcap",
    ".csv": "; a .csv has no levels and no actuators, and taxel.load_frames reads frames from one",
}
"""What to do with other files that taxel writes."""


def _npz(name: str) -> Images:
    with open(name, "rb") as file:
        try:
            with arrays_of(file) as arrays:
                if "counts" in arrays and "seq" not in arrays:
                    raise ValueError("it has frames, which taxel.load_frames reads")
                return _of_arrays(arrays)
        except Exception as error:  # numpy, zipfile and zlib have a dozen kinds for what is damaged
            raise ValueError(f"{name}: no .npz as `taxel compress` writes it: {error}") from None


def arrays_of(file: Any) -> Any:
    """The arrays of an open .npz. numpy takes what is none for a pickle, and advises to trust it."""
    if not zipfile.is_zipfile(file):
        raise ValueError("it is no archive of arrays")
    file.seek(0)
    return np.load(file)


def _of_arrays(arrays: Any) -> Images:
    frames, rows = len(arrays["seq"]), arrays["actuators"]
    images = Images(
        pixels=arrays["images"],
        seq=arrays["seq"],
        t_ns=arrays["t_ns"],
        contacts=arrays["contacts"].astype(np.uint32),
        faulty=arrays["faulty"].astype(np.uint32),
        missing=arrays["missing"].astype(np.uint32),
        joints=arrays["joints"] if "joints" in arrays else np.zeros((frames, 0), np.float32),
        levels=arrays["levels"],
        actuators=[messages.actuators(row[~np.isnan(row[:, 0])]) for row in rows],
    )
    for field in fields(images):
        column = getattr(images, field.name)
        if len(column) != frames:
            raise ValueError(f"{len(column)} {field.name} and {frames} seq")
        if field.name in _DIMENSIONS and column.ndim != _DIMENSIONS[field.name]:
            raise ValueError(f"{field.name} of shape {column.shape}")
    return images


def _jsonl(name: str) -> Images:
    return _stack(_lines(name))


def _lines(name: str) -> Iterator[Tuple[str, messages.Image]]:
    is_first = True
    with open(name, "rb") as file:
        for number, line in enumerate(file, 1):
            if not line.strip():
                continue
            place = f"{name}:{number}"
            try:
                value = json.loads(line)
            except ValueError as error:
                if not is_first and not line.endswith(b"\n"):
                    # Whoever wrote it was killed, or its machine lost its power.
                    warnings.warn(f"{place}: torn, and left out", stacklevel=2)
                    return
                raise _no_image(place, error) from None
            try:
                image = _of_object(value)
            except (ValueError, KeyError, TypeError, OverflowError) as error:
                raise _no_image(place, error) from None
            is_first = False
            yield place, image


def _no_image(place: str, error: Exception) -> ValueError:
    return ValueError(f"{place}: no image as `taxel watch --json` prints one: {error!r}")


def _of_object(value: Any) -> messages.Image:
    shape = (int(value["height"]), int(value["width"]))
    rows = [(a["id"], a["x"], a["y"], a["level"], a["force"]) for a in value["actuators"]]
    angles: List[Optional[float]] = value["joints"]
    return messages.Image(
        seq=_whole(value["seq"], 64),
        t_ns=_whole(value["t_ns"], 64),
        pixels=np.frombuffer(bytes([*value["image"]]), np.uint8).reshape(shape),
        levels=np.array(value["levels"], np.float64),
        actuators=messages.actuators(rows),
        joints=np.array([np.nan if angle is None else angle for angle in angles], np.float32),
        contacts=_whole(value["contacts"], 32),
        faulty=_whole(value["faulty"], 32),
        missing=_whole(value["missing"], 32),
    )


def _whole(number: Any, bits: int) -> int:
    if not 0 <= operator.index(number) < 1 << bits:
        # Some versions of numpy would wrap it around.
        raise ValueError(f"{number} is no number of {bits} bits")
    return int(number)


def _bin(name: str) -> Images:
    return _stack(_packets(name))


def _packets(name: str) -> Iterator[Tuple[str, messages.Image]]:
    data, at = memoryview(FilePath(name).read_bytes()), 0
    while at < len(data):
        place = f"{name}: byte {at}"
        try:
            message, length = _reader.decode(data[at:])
            image = messages.of_reader(message)
        except ValueError as error:
            raise ValueError(f"{place}: {error}") from None
        if isinstance(image, messages.Image):
            yield place, image
        at += length


def _stack(found: Iterable[Tuple[str, messages.Image]]) -> Images:
    images: List[messages.Image] = []
    for place, image in found:
        images.append(image)
        these, first = ((*each.pixels.shape, len(each.joints)) for each in (image, images[0]))
        if these != first:
            kind = "{} rows, {} columns and {} joints"
            raise ValueError(f"{place}: an image of {kind.format(*these)} behind those of {kind.format(*first)}")
    most = max((len(image.levels) for image in images), default=0)
    levels = np.full((len(images), most), np.nan)
    for row, image in zip(levels, images):
        row[: len(image.levels)] = image.levels
    height, width, joints = (*images[0].pixels.shape, len(images[0].joints)) if images else (0, 0, 0)

    def column(key: str, kind: Any) -> Any:
        return np.array([getattr(image, key) for image in images], kind)

    return Images(
        pixels=column("pixels", np.uint8).reshape(len(images), height, width),
        seq=column("seq", np.uint64),
        t_ns=column("t_ns", np.uint64),
        contacts=column("contacts", np.uint32),
        faulty=column("faulty", np.uint32),
        missing=column("missing", np.uint32),
        joints=column("joints", np.float32).reshape(len(images), joints),
        levels=levels,
        actuators=[image.actuators for image in images],
    )
