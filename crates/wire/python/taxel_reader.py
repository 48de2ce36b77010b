#!/usr/bin/env python3
"""Reads the tactile images that taxeld sends to display drivers.

One file to copy, however long; Python 3.8 or later, standard library only. The format is specified in docs/wire.md.

    import taxel_reader

    for image in taxel_reader.connect("/run/taxeld/images.sock"):
        for actuator in image.actuators:
            display.press(actuator.id, actuator.level)

`python3 taxel_reader.py SOCKET` prints one line per image. `decode_packet` and `decode` read bytes that came
another way. With numpy, `numpy.frombuffer(image.pixels, numpy.uint8).reshape(image.height, image.width)`.

SPDX-License-Identifier: Apache-2.0 OR MIT
"""

import errno
import json
import math
import os
import re
import select
import socket
import stat
import struct
import sys
import time
from typing import Any, Dict, Generator, Iterator, List, NamedTuple, Optional, Tuple, Union

MAGIC = b"TCT1"
MAJOR = 1
MINOR = 1
HEADER_LEN = 40
MAX_MESSAGE = 409_600
"""The most bytes a message may have, header included."""
MAX_TEXT = 8 << 20
"""The most bytes of text put together from several messages."""
_PATIENCE_S = 5.0
"""How long a daemon is waited for that takes no connection."""

HELLO, IMAGE, STATUS, EVENT, RAW, TOUCH, ESTIMATE, SUBSCRIBE = 1, 2, 3, 4, 5, 6, 7, 16

FLAG_MISSING = 1 << 0
FLAG_FAULTY = 1 << 1
FLAG_CALIBRATING = 1 << 2
FLAG_REPAIRED = 1 << 3
FLAG_GAP = 1 << 4
FLAG_SATURATED = 1 << 5
FLAG_MORE = 1 << 15

FAULTS = ("dead", "stuck", "noisy", "wrapping", "paper-rule", "status", "missing", "masked")
"""Names of the bits of `RawTaxel.faults`, from bit 0."""

FRESHNESS = ("missing", "stale", "fresh")

_HEADER = struct.Struct("<4sBBHHHIQQII")
_IMAGE_FIXED = struct.Struct("<6H3I")
_ACTUATOR = struct.Struct("<4Hf")
_RAW_FIXED = struct.Struct("<IHHfHH")
_RAW_SECTIONS = struct.Struct("<I")
_RAW_TAXEL = struct.Struct("<4HfI4B")
_JOINT_AGES, _JOINT_VELOCITIES, _JOINT_CURRENTS, _BASELINES = 1, 2, 4, 8

Bytes = Union[bytes, bytearray, memoryview]


class DecodeError(ValueError):
    """Bytes that are no message. `name` is the same in the readers of all languages."""

    def __init__(self, name: str, message: str) -> None:
        super().__init__(f"{name}: {message}")
        self.name = name

    @property
    def needs_more(self) -> bool:
        """Whether the bytes may be the start of a good message that has not wholly arrived."""
        return self.name in ("short_header", "truncated")


class Closed(ConnectionError):
    """The daemon closed the connection; `reason` is what it said about it, or empty."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason or "taxeld closed the connection")
        self.reason = reason


class Header(NamedTuple):
    """The header of a message."""

    major: int
    minor: int
    header_len: int
    type: int
    flags: int
    payload_len: int
    seq: int
    """Number of the tactile frame."""
    t_ns: int
    """Time of validity, nanoseconds on the clock that HELLO names."""
    skipped: int
    """Messages of this type that this reader was not given since its last one or, in the first, since it asked."""

    def has(self, flag: int) -> bool:
        """Whether a flag is set, such as FLAG_CALIBRATING."""
        return bool(self.flags & flag)


class Actuator(NamedTuple):
    """One actuator that presses."""

    id: int
    x: int
    """Column, inside the image."""
    y: int
    """Row, inside the image."""
    level: int
    """Force level, from 1 to the number of levels."""
    force: float
    """Force of that level, in HELLO's unit."""


class Image(NamedTuple):
    """A tactile image."""

    header: Header
    width: int
    height: int
    pixels: bytes
    """Greys 0 to 255, row by row from the top left; 0 is no contact."""
    levels: Tuple[float, ...]
    """The force of each level, ascending, in HELLO's unit."""
    actuators: Tuple[Actuator, ...]
    joints: Tuple[float, ...]
    """Joint angles, radians; not a number where an angle could not be read."""
    contacts: int
    faulty: int
    missing: int

    @property
    def seq(self) -> int:
        """Number of the tactile frame."""
        return self.header.seq

    @property
    def t_ns(self) -> int:
        """Time of validity, nanoseconds on the clock that HELLO names."""
        return self.header.t_ns

    @property
    def skipped(self) -> int:
        """Images that this reader was not given since its last one or, in the first, since it asked."""
        return self.header.skipped

    @property
    def calibrating(self) -> bool:
        """Whether the baseline is being measured; the image is empty then."""
        return self.header.has(FLAG_CALIBRATING)

    def rows(self) -> List[bytes]:
        """The image's rows, from the top."""
        return [self.pixels[y * self.width : (y + 1) * self.width] for y in range(self.height)]


class RawTaxel(NamedTuple):
    """One taxel as its board sent it, and what was made of it."""

    counts: Tuple[int, int, int]
    """Raw counts of x, y, z."""
    faults: int
    """Bits: why the taxel is not used; see FAULTS. 0 where it is."""
    force: float
    """Magnitude above baseline, in HELLO's unit."""
    age_us: int
    """Age of the value, microseconds; 4294967295 where missing."""
    freshness: int
    """0 missing, 1 stale, 2 of this frame."""
    status: int
    """The board's status byte."""
    contact: bool
    repaired: bool

    def press(self, baseline: Tuple[float, float, float]) -> Tuple[float, float, float]:
        """How far the counts x, y, z are from this baseline: the signed press.

        Counts wrap around modulo 65536, so each difference is taken into -32768 to 32768. Not a number where the
        baseline is none.
        """
        x, y, z = (_press(count, rest) for count, rest in zip(self.counts, baseline))
        return x, y, z


class Raw(NamedTuple):
    """The raw counts of a tactile frame."""

    header: Header
    threshold: float
    """The contact threshold, in HELLO's unit of force."""
    taxels: Tuple[RawTaxel, ...]
    """In the order of the taxels' numbers."""
    joints: Tuple[float, ...]
    """Joint angles, radians; not a number where an angle could not be read."""
    joint_ages_us: Optional[Tuple[int, ...]] = None
    """Time from the frame's to each joint's nearest reading, microseconds; 4294967295 where unknown."""
    joint_velocities: Optional[Tuple[float, ...]] = None
    """Radians per second; not a number where unknown, None where the message has none."""
    joint_currents: Optional[Tuple[float, ...]] = None
    """Present currents of the joints' servos, amperes; not a number where unknown, None where there are none."""
    baselines: Optional[Tuple[Tuple[float, float, float], ...]] = None
    """The value at rest of each taxel, counts x, y, z, for `RawTaxel.press`; not a number while calibrating, and where
    unknown. None where the message has none."""


class Text(NamedTuple):
    """A message whose payload is JSON: HELLO, STATUS, EVENT, TOUCH, ESTIMATE or SUBSCRIBE. Not parsed yet."""

    header: Header
    text: bytes

    def json(self) -> Any:
        """The parsed text. Raises ValueError where it is not JSON."""
        return json.loads(self.text.decode("utf-8"))


class Unknown(NamedTuple):
    """A message of a type that a later version defines."""

    header: Header
    payload: bytes


Message = Union[Image, Raw, Text, Unknown]


def decode_header(data: Bytes) -> Header:
    """Decodes the header at the start of `data`; the payload need not be there yet. Raises DecodeError."""
    if len(data) < HEADER_LEN:
        raise DecodeError("short_header", f"{len(data)} bytes are no message: a header has {HEADER_LEN}")
    magic, *fields, _reserved = _HEADER.unpack_from(data)
    header = Header(*fields)
    if magic != MAGIC:
        raise DecodeError("bad_magic", f"starts with {magic!r} instead of {MAGIC!r}; check the socket path")
    if header.major != MAJOR:
        raise DecodeError("major_version", f"the sender speaks version {header.major}, this reader {MAJOR}")
    if header.header_len < HEADER_LEN:
        raise DecodeError("header_len", f"header_len {header.header_len} is below {HEADER_LEN}")
    if header.header_len + header.payload_len > MAX_MESSAGE:
        raise DecodeError("too_long", f"payload_len {header.payload_len} makes more than {MAX_MESSAGE} bytes")
    return header


def decode(data: Bytes) -> Tuple[Message, int]:
    """Decodes the message at the start of `data`, as on a stream; returns it and its length in bytes.

    Raises DecodeError; where its `needs_more` holds, try again with more bytes.
    """
    header = decode_header(data)
    expected = header.header_len + header.payload_len
    if len(data) < expected:
        raise DecodeError("truncated", f"{len(data)} bytes of a message of {expected}")
    payload = bytes(memoryview(data)[header.header_len : expected])
    if header.type == IMAGE:
        return _decode_image(header, payload), expected
    if header.type == RAW:
        return _decode_raw(header, payload), expected
    if header.type in (HELLO, STATUS, EVENT, TOUCH, ESTIMATE, SUBSCRIBE):
        return Text(header, payload), expected
    return Unknown(header, payload), expected


def decode_packet(packet: Bytes) -> Message:
    """Decodes a packet, which holds exactly one message. Raises DecodeError."""
    header = decode_header(packet)
    extra = len(packet) - header.header_len - header.payload_len
    if extra > 0:
        raise DecodeError("trailing", f"{extra} bytes follow the message in its packet")
    return decode(packet)[0]


def _decode_image(header: Header, payload: bytes) -> Image:
    if len(payload) < _IMAGE_FIXED.size:
        raise DecodeError("section_short", f"an image's payload of {len(payload)} bytes")
    fields = _IMAGE_FIXED.unpack_from(payload)
    width, height, levels, actuators, joints, fixed_len, contacts, faulty, missing = fields
    _check_len("fixed_len", fixed_len, _IMAGE_FIXED.size)
    actuators_at = fixed_len + 4 * levels
    joints_at = actuators_at + _ACTUATOR.size * actuators
    pixels_at = joints_at + 4 * joints
    end = pixels_at + width * height
    if end > len(payload):
        raise DecodeError("section_short", f"{len(payload)} bytes, and the sections need {end}")
    image = Image(
        header=header,
        width=width,
        height=height,
        pixels=payload[pixels_at:end],
        levels=struct.unpack_from(f"<{levels}f", payload, fixed_len),
        actuators=tuple(Actuator(*f) for f in _ACTUATOR.iter_unpack(payload[actuators_at:joints_at])),
        joints=struct.unpack_from(f"<{joints}f", payload, joints_at),
        contacts=contacts,
        faulty=faulty,
        missing=missing,
    )
    for index, force in enumerate(image.levels):
        _check_force("level", index, force)
    for index, actuator in enumerate(image.actuators):
        if actuator.x >= width or actuator.y >= height or not 1 <= actuator.level <= levels:
            raise DecodeError("bad_actuator", f"{actuator} lies outside the image or the codebook")
        _check_force("actuator", index, actuator.force)
    return image


def _decode_raw(header: Header, payload: bytes) -> Raw:
    if len(payload) < _RAW_FIXED.size:
        raise DecodeError("section_short", f"a raw payload of {len(payload)} bytes")
    taxels, record_len, fixed_len, threshold, joints, _reserved = _RAW_FIXED.unpack_from(payload)
    _check_len("fixed_len", fixed_len, _RAW_FIXED.size)
    _check_len("record_len", record_len, _RAW_TAXEL.size)
    known = 0
    if fixed_len >= _RAW_FIXED.size + _RAW_SECTIONS.size <= len(payload):
        (known,) = _RAW_SECTIONS.unpack_from(payload, _RAW_FIXED.size)
    joints_at = fixed_len + record_len * taxels
    # Where each section starts, in the order of the bits; those not there have no length.
    ages_at = joints_at + 4 * joints
    velocities_at = ages_at + (4 * joints if known & _JOINT_AGES else 0)
    currents_at = velocities_at + (4 * joints if known & _JOINT_VELOCITIES else 0)
    baselines_at = currents_at + (4 * joints if known & _JOINT_CURRENTS else 0)
    end = baselines_at + (12 * taxels if known & _BASELINES else 0)
    if end > len(payload):
        raise DecodeError("section_short", f"{len(payload)} bytes, and the sections need {end}")

    def of_joints(bit: int, form: str, at: int) -> Any:
        return struct.unpack_from(f"<{joints}{form}", payload, at) if known & bit else None

    return Raw(
        header=header,
        threshold=threshold,
        taxels=tuple(_raw_taxel(payload, at) for at in range(fixed_len, joints_at, record_len)),
        joints=struct.unpack_from(f"<{joints}f", payload, joints_at),
        joint_ages_us=of_joints(_JOINT_AGES, "I", ages_at),
        joint_velocities=of_joints(_JOINT_VELOCITIES, "f", velocities_at),
        joint_currents=of_joints(_JOINT_CURRENTS, "f", currents_at),
        baselines=tuple(struct.iter_unpack("<3f", payload[baselines_at:end])) if known & _BASELINES else None,
    )


def _press(count: int, rest: float) -> float:
    difference = count - rest
    # Counts and baselines are within a few turns of each other; what is farther away is no baseline.
    if not abs(difference) < 16_777_216:
        return math.nan
    return (difference + 32768) % 65536 - 32768


def _raw_taxel(payload: bytes, offset: int) -> RawTaxel:
    x, y, z, faults, force, age_us, freshness, status, marks, _reserved = _RAW_TAXEL.unpack_from(payload, offset)
    if freshness >= len(FRESHNESS):
        freshness = 0
    return RawTaxel((x, y, z), faults, force, age_us, freshness, status, bool(marks & 1), bool(marks & 2))


def _check_len(field: str, value: int, least: int) -> None:
    if value < least or value % 4:
        raise DecodeError("fixed_len", f"{field} is {value}; at least {least} and a multiple of 4 expected")


def _check_force(section: str, index: int, force: float) -> None:
    if not (math.isfinite(force) and force >= 0):
        raise DecodeError("bad_force", f"{section} {index} has force {force}")


def encode_subscribe(wanted: Dict[str, Any]) -> bytes:
    """The packet that asks for other things than every image; keys as for `Reader.subscribe`."""
    text = json.dumps(wanted).encode()
    return _HEADER.pack(MAGIC, MAJOR, MINOR, HEADER_LEN, SUBSCRIBE, 0, len(text), 0, 0, 0, 0) + text


class Reader:
    """A connection to the daemon's data socket. Iterating gives images, and raises Closed at the end.

    `hello` is the newest description of hand and display (docs/wire.md lists its keys), None before it came.
    `event` is the newest event, such as {"event": "calibrating", "message": "..."}.
    """

    def __init__(self, connection: socket.socket) -> None:
        self.socket = connection
        self.hello: Optional[Dict[str, Any]] = None
        self.event: Optional[Dict[str, Any]] = None
        self._buffer = bytearray(MAX_MESSAGE)
        self._text = bytearray()
        self._unfinished: Optional[int] = None

    def __enter__(self) -> "Reader":
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()

    def __iter__(self) -> Iterator[Image]:
        while True:
            message = self.receive()
            if isinstance(message, Image):
                yield message

    def close(self) -> None:
        """Closes the connection."""
        self.socket.close()

    def fileno(self) -> int:
        """The descriptor, so that select and its like take a Reader."""
        return self.socket.fileno()

    def receive(self, timeout: Optional[float] = None) -> Optional[Message]:
        """The next message of any type; None where none is whole within `timeout` seconds.

        A text in several parts comes as one. Raises Closed when the daemon closes, OSError when the connection
        fails, DecodeError for a bad message, after which the next may be read.
        """
        deadline = None if timeout is None else time.monotonic() + timeout
        while True:
            wait = None if deadline is None else max(0.0, deadline - time.monotonic())
            if not self._wait(wait):
                return None
            try:
                length = self.socket.recv_into(self._buffer)
            except ConnectionResetError:
                # The daemon left with a subscription unread; what it said before can be read still.
                continue
            if length == 0:
                raise self._closed()
            message = self._assemble(decode_packet(memoryview(self._buffer)[:length]))
            if message is not None:
                return message

    def _wait(self, seconds: Optional[float]) -> bool:
        """Waits until something can be read. Not `select`, which takes no descriptor above 1023."""
        waiting = select.poll()
        waiting.register(self.socket, select.POLLIN)
        # Rounded up, so that the last wait does not spin.
        return bool(waiting.poll(None if seconds is None else math.ceil(1000 * seconds)))

    def subscribe(self, **wanted: Any) -> None:
        """Asks for other things than every image: image, raw, status (bool), max_rate_hz.

        `every=True` is for recorders and analyses: every image and raw frame in order, instead of the newest; what
        was lost all the same is counted in `skipped`. It goes with no max_rate_hz.
        `profile={"levels": 4, "actuators": 5}` says what the display can do and `region=["index", "thumb"]` which parts
        of the hand it shows. The answer is a HELLO, whose "subscription" is in force from then on, or an event "refused"
        that says why not. Raises Closed where the daemon has closed the connection; what else was unread is passed over.
        """
        try:
            self.socket.send(encode_subscribe(wanted))
        except (BrokenPipeError, ConnectionResetError):
            raise self._farewell() from None

    def _closed(self) -> Closed:
        said = self.event or {}
        return Closed(str(said.get("message", "")) if said.get("event") == "disconnect" else "")

    def _farewell(self) -> Closed:
        """Why the daemon closes the connection: what it sends last may come after it has ceased to read."""
        deadline = time.monotonic() + _PATIENCE_S
        while time.monotonic() < deadline and not self._closed().reason:
            try:
                self.receive(timeout=deadline - time.monotonic())
            except Closed as closed:
                return closed
            except DecodeError:
                pass
        return self._closed()

    def latency_ns(self, header: Header) -> Optional[int]:
        """How long ago a message's time of validity was; None where HELLO's clock tells none."""
        clock = (self.hello or {}).get("clock")
        if clock == "CLOCK_MONOTONIC":
            return time.clock_gettime_ns(time.CLOCK_MONOTONIC) - header.t_ns
        if clock == "CLOCK_REALTIME":
            return time.clock_gettime_ns(time.CLOCK_REALTIME) - header.t_ns
        return None

    def _assemble(self, message: Message) -> Optional[Message]:
        kind = message.header.type
        unfinished, self._unfinished = self._unfinished, None
        if unfinished not in (None, kind):
            raise DecodeError("broken_text", f"the text of a message of type {unfinished} was cut off")
        if not isinstance(message, Text):
            return message
        if unfinished is None:
            self._text.clear()
        if len(self._text) + len(message.text) > MAX_TEXT:
            raise DecodeError("broken_text", f"the text of a message of type {kind} is above {MAX_TEXT} bytes")
        self._text += message.text
        if message.header.has(FLAG_MORE):
            self._unfinished = kind
            return None
        whole = Text(message.header, bytes(self._text))
        if kind in (HELLO, EVENT):
            try:
                parsed = whole.json()
            except ValueError as error:
                raise DecodeError("bad_json", f"a message of type {kind}: {error}") from error
            if not isinstance(parsed, dict):
                raise DecodeError("bad_json", f"a message of type {kind} is no JSON object")
            if kind == HELLO:
                self.hello = parsed
            else:
                self.event = parsed
        return whole


def _check_folder(path: str) -> None:
    """Refuses a socket in a folder /tmp/taxeld-UID that somebody else than UID owns or may write: it may be anybody's."""
    folder = os.path.dirname(path)
    named = re.fullmatch("/tmp/taxeld-([0-9]+)", folder)
    if not named or not os.path.lexists(folder):
        return
    found = os.lstat(folder)
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != int(named[1]) or found.st_mode & 0o022:
        raise PermissionError(errno.EACCES, "not a folder that only the user of its name owns and may write", folder)


def attempts(connection: socket.socket, place: str, patience_s: float) -> Iterator[float]:
    """Connects to a Unix socket without ever blocking; yields the seconds to wait before each further attempt.

    Raises OSError; TimeoutError where there is no room for the connection for `patience_s`.
    """
    # A socket that blocks would wait for ever for room in the queue of those that are not accepted yet.
    connection.setblocking(False)
    until = time.monotonic() + patience_s
    while True:
        try:
            connection.connect(place)
            return
        except BlockingIOError:
            if time.monotonic() > until:
                words = "taxeld takes no connection; its log says what it does, and where it hangs, restart it"
                raise TimeoutError(errno.ETIMEDOUT, words, place) from None
        yield 0.01


def connecting(
    path: Union[str, bytes, "os.PathLike[str]", "os.PathLike[bytes]"], **wanted: Any
) -> Generator[float, None, Reader]:
    """As `connect`, for an event loop: never blocks, yields the seconds to wait before each further attempt, returns the
    reader. Raises what `connect` does; closing the generator gives it up.
    """
    place = os.fsdecode(path)
    _check_folder(place)
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    try:
        yield from attempts(connection, place, _PATIENCE_S)
        reader = Reader(connection)
        if wanted:
            # There is room for it: nothing was sent yet.
            reader.subscribe(**wanted)
    except BaseException as error:
        connection.close()
        if isinstance(error, OSError) and error.errno == errno.EPROTOTYPE:
            raise OSError(error.errno, "requests go there; images come from images.sock beside it", place) from None
        raise
    connection.setblocking(True)
    return reader


def connect(path: Union[str, bytes, "os.PathLike[str]", "os.PathLike[bytes]"], **wanted: Any) -> Reader:
    """Connects to the daemon that listens at `path`; keywords as for `Reader.subscribe`.

    Raises OSError: FileNotFoundError or ConnectionRefusedError where no daemon runs, PermissionError where
    this user may not read from it, or where it is in a folder /tmp/taxeld-UID that is not UID's alone, with errno
    EPROTOTYPE where it is a socket that takes requests, TimeoutError where the daemon takes no connection for five seconds,
    as one that hangs, Closed where it has no place for this client.
    """
    steps = connecting(path, **wanted)
    while True:
        try:
            time.sleep(next(steps))
        except StopIteration as connected:
            reader: Reader = connected.value
            return reader


def line(image: Image, latency_ns: Optional[int] = None) -> str:
    """An image in one line, for people."""
    presses = " ".join(f"{a.id}@{a.x},{a.y}={a.level}" for a in image.actuators)
    latency = "" if latency_ns is None else f" {latency_ns / 1000:.0f}us"
    trouble = f" faulty={image.faulty}" if image.faulty else ""
    trouble += f" missing={image.missing}" if image.missing else ""
    trouble += f" skipped={image.skipped}" if image.skipped else ""
    trouble += " calibrating" if image.calibrating else ""
    return f"{image.seq}{latency} contacts={image.contacts}{trouble} | {presses}"


def main(arguments: List[str]) -> int:
    """Prints one line per image until the daemon closes."""
    if len(arguments) != 1 or arguments[0].startswith("-"):
        print("usage: taxel_reader.py SOCKET", file=sys.stderr)
        return 2
    try:
        with connect(arguments[0]) as reader:
            for image in reader:
                print(line(image, reader.latency_ns(image.header)), flush=True)
    except BrokenPipeError:
        # Whoever read the output has seen enough; nothing more is to be written to it, not even at the end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except (OSError, DecodeError) as error:
        print(f"taxel_reader: {arguments[0]}: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        pass
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
