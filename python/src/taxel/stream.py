"""A subscription that outlives the daemon's restarts."""

import os
import time
from typing import Any, Dict, Iterator, Optional, Sequence, Union

from . import _reader, messages
from .errors import Refused
from .place import running_socket

Path = Union[str, "os.PathLike[str]"]

RETRY_S = 0.2
"""Between two attempts to reach a daemon that has gone."""


class Subscription:
    """What is asked of the daemon, anew on each connection, and what it answered."""

    def __init__(self, path: Optional[Path], wanted: Dict[str, Any]) -> None:
        self.path = os.fspath(running_socket("images.sock") if path is None else path)
        self.wanted = wanted
        self.reader: Optional[_reader.Reader] = None
        self.restarts = 0
        """How often the daemon went away and came back."""
        self.gone = ""
        """Why the daemon is gone; empty while it is there."""
        self._unanswered = 0
        """HELLOs until what is asked for is in force: the first of a connection, and the answer."""

    @property
    def hello(self) -> Dict[str, Any]:
        """The newest description of hand and display (docs/wire.md, "HELLO"); empty before one came."""
        return (self.reader.hello if self.reader else None) or {}

    def open(self) -> "_reader.Reader":
        """Connects where it is not connected. Raises OSError."""
        if self.reader is None:
            reader = _reader.connect(self.path, **self.wanted)
            self.restarts += bool(self.gone)
            self.gone = ""
            self.reader = reader
            self._unanswered = 2 if self.wanted else 0
        return self.reader

    def take(self, reader: "_reader.Reader", seconds: float) -> Optional[messages.Message]:
        """The next message for the user; None where there is none in time. Raises OSError where the daemon is gone."""
        received = reader.receive(timeout=seconds)
        if received is None:
            return None
        if self._unanswered and received.header.type == _reader.HELLO:
            answers = "subscription" in self.hello or {"profile", "region"} & self.wanted.keys()
            self._unanswered -= 1 if answers else 2
        message = messages.of_reader(received)
        if self._unanswered > 0 and isinstance(message, (messages.Image, messages.Raw)):
            # Made for the daemon's own display, before it had read what this one is.
            return None
        if isinstance(message, messages.Event) and message.event == "refused":
            raise Refused(message.message)
        return message

    def lose(self, error: OSError) -> None:
        """The daemon is gone, or not there yet."""
        self.gone = str(error) or "taxeld is gone"
        self.close()

    def close(self) -> None:
        """Ends the connection."""
        if self.reader:
            self.reader.close()
            self.reader = None


def wanted(
    raw: bool,
    status: bool,
    every: bool,
    max_rate_hz: Optional[float],
    profile: Optional[Dict[str, Any]],
    region: Optional[Sequence[str]],
) -> Dict[str, Any]:
    """The keys of a SUBSCRIBE; those that ask for nothing are left out."""
    keys: Dict[str, Any] = {"raw": raw, "status": status, "every": every}
    keys = {key: value for key, value in keys.items() if value}
    if max_rate_hz is not None:
        keys["max_rate_hz"] = max_rate_hz
    if profile is not None:
        keys["profile"] = profile
    if region is not None:
        keys["region"] = list(region)
    return keys


class Stream:
    """The images of a running daemon, across its restarts. Made by `connect`."""

    def __init__(self, subscription: Subscription) -> None:
        self._subscription = subscription
        self._gives_all = bool(subscription.wanted.get("raw") or subscription.wanted.get("status"))
        self._closed = False

    def __enter__(self) -> "Stream":
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()

    def __iter__(self) -> Iterator[Any]:
        """Images; with raw or status every message. Ends when the stream is closed."""
        while not self._closed:
            message = self.message()
            if message is not None and (self._gives_all or isinstance(message, messages.Image)):
                yield message

    @property
    def hello(self) -> Dict[str, Any]:
        """The newest description of hand and display (docs/wire.md, "HELLO"); empty before one came."""
        return self._subscription.hello

    @property
    def restarts(self) -> int:
        """How often the daemon went away and came back."""
        return self._subscription.restarts

    @property
    def gone(self) -> str:
        """Why the daemon is gone; empty while it is there."""
        return self._subscription.gone

    def images(self, timeout: Optional[float] = None) -> Iterator[Optional[messages.Image]]:
        """Images; with a time-out None each time that so many seconds bring none, as a display needs to let go."""
        while not self._closed:
            yield self.next(timeout)

    def next(self, timeout: Optional[float] = None) -> Optional[messages.Image]:
        """The next image; None where none came within `timeout` seconds, or the stream was closed."""
        deadline = None if timeout is None else time.monotonic() + timeout
        while not self._closed:
            left = None if deadline is None else max(0.0, deadline - time.monotonic())
            message = self.message(left)
            if isinstance(message, messages.Image):
                return message
            if deadline is not None and time.monotonic() >= deadline:
                break
        return None

    def message(self, timeout: Optional[float] = None) -> Optional[messages.Message]:
        """The next message of any kind; None where none came in time. Waits for a daemon that has gone.

        Raises Refused where the daemon refuses the subscription, DecodeError for a bad message.
        """
        subscription = self._subscription
        deadline = None if timeout is None else time.monotonic() + timeout
        while not self._closed:
            left = RETRY_S if deadline is None else min(RETRY_S, max(0.0, deadline - time.monotonic()))
            try:
                message = subscription.take(subscription.open(), left)
            except PermissionError:
                raise
            except OSError as error:
                subscription.lose(error)
                time.sleep(left)
                message = None
            if message is not None:
                return message
            if deadline is not None and time.monotonic() >= deadline:
                return None
        return None

    def latency_ns(self, message: messages.Message) -> Optional[int]:
        """How long ago a message's time of validity was; None where HELLO's clock tells none."""
        clock = self.hello.get("clock")
        if clock not in ("CLOCK_MONOTONIC", "CLOCK_REALTIME"):
            return None
        return time.clock_gettime_ns(getattr(time, clock)) - message.t_ns

    def close(self) -> None:
        """Ends the stream, and whoever iterates it."""
        self._closed = True
        self._subscription.close()


def connect(
    path: Optional[Path] = None,
    *,
    raw: bool = False,
    status: bool = False,
    every: bool = False,
    max_rate_hz: Optional[float] = None,
    profile: Optional[Dict[str, Any]] = None,
    region: Optional[Sequence[str]] = None,
    wait: bool = False,
) -> Stream:
    """Connects to a running daemon; by default to that of this user, or else of the system.

    `raw` asks for the counts of every taxel too, `status` for the daemon's status once a second, `every` for every
    frame in order instead of the newest, `profile` states what the display can do and `region` which parts of the hand
    it shows. Raises OSError where no daemon runs, unless `wait` is true; once connected, a daemon that goes is waited
    for.
    """
    subscription = Subscription(path, wanted(raw, status, every, max_rate_hz, profile, region))
    stream = Stream(subscription)
    try:
        subscription.open()
    except PermissionError:
        raise
    except (FileNotFoundError, ConnectionRefusedError) as error:
        if not wait:
            text = f"no taxeld listens at {subscription.path}; start one, or connect with wait=True"
            raise type(error)(error.errno, text) from None
    return stream
