"""What the daemon sends, as numpy arrays."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Dict, Optional, Tuple, Union

import numpy as np

from . import _reader

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Records = np.recarray[Any, np.dtype[Any]]

ACTUATOR = np.dtype([("id", "<u2"), ("x", "<u2"), ("y", "<u2"), ("level", "<u2"), ("force", "<f4")])
"""An actuator that presses: its number, column, row, force level from 1, and force in HELLO's unit."""


@dataclass(frozen=True, eq=False)
class Image:
    """A tactile image."""

    seq: int
    """Number of the tactile frame."""
    t_ns: int
    """Time of validity, nanoseconds on the clock that HELLO names."""
    pixels: "NDArray[np.uint8]"
    """Greys 0 to 255, height x width; 0 is no contact."""
    levels: "NDArray[np.float64]"
    """The force of each level, ascending, in HELLO's unit; level k is levels[k - 1]."""
    actuators: "Records"
    """Those that press: id, x, y, level, force."""
    joints: "NDArray[np.float32]"
    """Joint angles, radians; not a number where unknown."""
    contacts: int
    """Taxels in contact."""
    faulty: int
    """Taxels out of use for a fault."""
    missing: int
    """Taxels whose value is missing or stale."""
    skipped: int = 0
    """Images that this reader was not given since its last one or, in the first, since it asked."""
    flags: int = 0
    """Bits of the header; docs/wire.md, "The header"."""

    @property
    def width(self) -> int:
        """Columns."""
        return int(self.pixels.shape[1])

    @property
    def height(self) -> int:
        """Rows."""
        return int(self.pixels.shape[0])

    @property
    def calibrating(self) -> bool:
        """Whether the baseline is being measured; the image is empty then."""
        return bool(self.flags & _reader.FLAG_CALIBRATING)


@dataclass(frozen=True, eq=False)
class Raw:
    """What each taxel's board sent in a tactile frame, and what was made of it, for N taxels in their order."""

    seq: int
    t_ns: int
    counts: "NDArray[np.uint16]"
    """Raw counts, N x 3: x, y, z."""
    force: "NDArray[np.float32]"
    """Magnitude above baseline, N, in HELLO's unit."""
    contact: "NDArray[np.bool_]"
    """Whether each taxel is in contact, N."""
    faults: "NDArray[np.uint16]"
    """Bits: why each taxel is not used, N; 0 where it is. `taxel.messages.FAULTS` names them."""
    age_us: "NDArray[np.uint32]"
    """Age of each value, N, microseconds; 4294967295 where missing."""
    freshness: "NDArray[np.uint8]"
    """0 missing, 1 stale, 2 of this frame; N."""
    status: "NDArray[np.uint8]"
    """Each board's status byte, N."""
    repaired: "NDArray[np.bool_]"
    """Whether the value was repaired in this frame, N."""
    threshold: float
    """The contact threshold, in HELLO's unit of force."""
    joints: "NDArray[np.float32]"
    """Joint angles, radians; not a number where unknown."""
    baselines: Optional["NDArray[np.float32]"]
    """Each taxel at rest, N x 3 counts; not a number where unknown, None where the message has none."""
    skipped: int = 0
    """Raw frames that this reader was not given since its last one."""
    flags: int = 0

    @property
    def press(self) -> "NDArray[np.float32]":
        """How far the counts are from the baseline, N x 3, signed; not a number where there is no baseline.

        Counts wrap around modulo 65536, so each difference is taken into -32768 to 32768.
        """
        if self.baselines is None:
            return np.full(self.counts.shape, np.nan, np.float32)
        difference = self.counts.astype(np.float64) - self.baselines
        return ((difference + 32768.0) % 65536.0 - 32768.0).astype(np.float32)


@dataclass(frozen=True)
class Event:
    """Something told to people, such as a mark or the beginning of calibration (docs/wire.md, "EVENT")."""

    event: str
    message: str
    seq: int
    t_ns: int


@dataclass(frozen=True)
class Text:
    """A STATUS, or a message of a program beside the daemon, parsed."""

    type: int
    """The message's number; docs/wire.md, "The header"."""
    value: Any
    seq: int
    t_ns: int


Message = Union[Image, Raw, Event, Text]

FAULTS = _reader.FAULTS
"""Names of the bits of `Raw.faults`, from bit 0."""


def of_reader(message: "_reader.Message") -> Optional[Message]:
    """A decoded message as arrays; None for HELLO and for what a later version defines."""
    header = message.header
    if isinstance(message, _reader.Image):
        return Image(
            seq=header.seq,
            t_ns=header.t_ns,
            pixels=np.frombuffer(message.pixels, np.uint8).reshape(message.height, message.width),
            levels=np.array(message.levels, np.float64),
            actuators=actuators(message.actuators),
            joints=np.array(message.joints, np.float32),
            contacts=message.contacts,
            faulty=message.faulty,
            missing=message.missing,
            skipped=header.skipped,
            flags=header.flags,
        )
    if isinstance(message, _reader.Raw):
        return _raw(message)
    if isinstance(message, _reader.Text) and header.type == _reader.EVENT:
        said: Dict[str, Any] = message.json()
        return Event(str(said.get("event", "notice")), str(said.get("message", "")), header.seq, header.t_ns)
    if isinstance(message, _reader.Text) and header.type != _reader.HELLO:
        return Text(header.type, message.json(), header.seq, header.t_ns)
    return None


def actuators(rows: Any) -> "Records":
    """Rows of id, x, y, level, force as a record array."""
    return np.array([tuple(row) for row in rows], ACTUATOR).view(np.recarray)


def _raw(message: "_reader.Raw") -> Raw:
    taxels = message.taxels
    columns: Tuple[Any, ...] = tuple(zip(*taxels)) if taxels else ((),) * len(_reader.RawTaxel._fields)
    column = dict(zip(_reader.RawTaxel._fields, columns))
    baselines = message.baselines
    return Raw(
        seq=message.header.seq,
        t_ns=message.header.t_ns,
        counts=np.array(column["counts"], np.uint16).reshape(-1, 3),
        force=np.array(column["force"], np.float32),
        contact=np.array(column["contact"], np.bool_),
        faults=np.array(column["faults"], np.uint16),
        age_us=np.array(column["age_us"], np.uint32),
        freshness=np.array(column["freshness"], np.uint8),
        status=np.array(column["status"], np.uint8),
        repaired=np.array(column["repaired"], np.bool_),
        threshold=message.threshold,
        joints=np.array(message.joints, np.float32),
        baselines=None if baselines is None else np.array(baselines, np.float32).reshape(-1, 3),
        skipped=message.header.skipped,
        flags=message.header.flags,
    )
