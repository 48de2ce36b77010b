"""A subscription that outlives the daemon's restarts."""

import time
from typing import Any, Dict, Iterator, Optional, Sequence, overload

from . import _reader, messages
from .arguments import Path, deadline, wanted
from .subscription import RETRY_S, Subscription


class Stream(Subscription):
    """The images of a running daemon, across its restarts. Made by `connect`."""

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

    @overload
    def images(self, timeout: None = None) -> Iterator[messages.Image]: ...

    @overload
    def images(self, timeout: float) -> Iterator[Optional[messages.Image]]: ...

    def images(self, timeout: Optional[float] = None) -> Iterator[Optional[messages.Image]]:
        """Images; with a time-out None each time that so many seconds bring none, as a display needs to let go."""
        while not self._closed:
            image = self.next(timeout)
            if image is not None or not self._closed:
                yield image

    def next(self, timeout: Optional[float] = None) -> Optional[messages.Image]:
        """The next image; None where none came within `timeout` seconds, or the stream was closed."""
        end = deadline(timeout)
        while not self._closed:
            message = self.message(end - time.monotonic())
            if isinstance(message, messages.Image):
                return message
            if time.monotonic() >= end:
                break
        return None

    def message(self, timeout: Optional[float] = None) -> Optional[messages.Message]:
        """The next message of any kind; None where none came in time, or the stream was closed.

        Waits for a daemon that has gone. Raises Refused where the daemon refuses the subscription, DecodeError for a
        bad message, RuntimeError where another thread is reading.
        """
        end = deadline(timeout)
        with self._reading():
            while not self._closed:
                message = None
                try:
                    for seconds in self._connecting():
                        if self._closed or time.monotonic() >= end:
                            return None
                        time.sleep(seconds)
                    message = self._take(_left(end))
                except PermissionError:
                    raise
                except OSError as error:
                    if self._closed:
                        break
                    self._lose(error)
                    time.sleep(_left(end))
                if message is not None or time.monotonic() >= end:
                    return message
        return None


def _left(end: float) -> float:
    """How long to wait at a time, seconds."""
    return min(RETRY_S, max(0.0, end - time.monotonic()))


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
    it shows. Raises OSError where no daemon runs, or it has no place for this client, unless `wait` is true; once
    connected, a daemon that goes is waited for.
    """
    stream = Stream(path, wanted(raw, status, every, max_rate_hz, profile, region))
    try:
        for seconds in stream._connecting():
            time.sleep(seconds)
    except PermissionError:
        raise
    except (FileNotFoundError, ConnectionRefusedError) as error:
        if not wait:
            text = f"no taxeld listens at {stream._path}; start one, or connect with wait=True"
            raise type(error)(error.errno, text) from None
    except _reader.Closed as error:
        if not wait:
            raise
        stream._lose(error)
    return stream
