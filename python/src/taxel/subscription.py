"""What both kinds of stream share."""

import contextlib
import os
import socket
import threading
import time
from typing import Any, Dict, Generator, Iterator, Optional

from . import _reader, messages
from .arguments import Path
from .errors import Refused
from .place import running_socket

RETRY_S = 0.2
"""Between two attempts to reach a daemon that has gone."""


class Subscription:
    """What is asked of the daemon, anew on each connection, and what it answered."""

    def __init__(self, path: Optional[Path], wanted: Dict[str, Any]) -> None:
        self._path = os.fsdecode(running_socket("images.sock") if path is None else path)
        self._wanted = wanted
        self._gives_all = "raw" in wanted or "status" in wanted
        self._reader: Optional[_reader.Reader] = None
        self._restarts = 0
        self._gone = ""
        self._lost = False
        """A daemon that was there went away, and none was there since."""
        self._unanswered = 0
        """HELLOs until what is asked for is in force: the first of a connection, and the answer."""
        self._closed = False
        self._alone = threading.Lock()

    @property
    def hello(self) -> Dict[str, Any]:
        """The newest description of hand and display (docs/wire.md, "HELLO"); empty before one came."""
        reader = self._reader
        return (reader.hello if reader else None) or {}

    @property
    def restarts(self) -> int:
        """How often the daemon went away and came back."""
        return self._restarts

    @property
    def gone(self) -> str:
        """Why the daemon is gone, or let this client go; empty once it has described the hand."""
        return self._gone

    def latency_ns(self, message: messages.Message) -> Optional[int]:
        """How long ago a message's time of validity was; None where HELLO's clock tells none."""
        clock = self.hello.get("clock")
        if clock not in ("CLOCK_MONOTONIC", "CLOCK_REALTIME"):
            return None
        return time.clock_gettime_ns(getattr(time, clock)) - message.t_ns

    def close(self) -> None:
        """Ends the stream, and whoever iterates it, from wherever it is called."""
        self._closed = True
        reader = self._reader
        if self._alone.acquire(blocking=False):
            self._disconnect()
            self._alone.release()
        elif reader:
            # Wakes whoever reads, who ends the connection: a descriptor that is waited for must not be closed.
            with contextlib.suppress(OSError):
                reader.socket.shutdown(socket.SHUT_RDWR)

    @contextlib.contextmanager
    def _reading(self) -> Iterator[None]:
        """Raises RuntimeError where somebody else reads: each would miss what the other is given."""
        if not self._alone.acquire(blocking=False):
            raise RuntimeError("somebody else is reading this stream; connect once for each reader")
        try:
            yield
        finally:
            self._alone.release()
            if self._closed:
                self.close()

    def _connecting(self) -> Generator[float, None, None]:
        """Connects where it is not connected; yields the seconds before each further attempt. Raises OSError."""
        if self._reader is None:
            self._reader = yield from _reader.connecting(self._path, **self._wanted)
            self._unanswered = 2 if self._wanted else 0

    def _take(self, seconds: float) -> Optional[messages.Message]:
        """The next message for the user; None where there is none in time. Raises OSError where the daemon is gone."""
        received = self._reader.receive(timeout=seconds) if self._reader else None
        if received is None or self._closed:
            return None
        if received.header.type == _reader.HELLO:
            self._restarts += self._lost
            self._lost = False
            self._gone = ""
        if self._unanswered and received.header.type == _reader.HELLO:
            answers = "subscription" in self.hello or {"profile", "region"} & self._wanted.keys()
            self._unanswered -= 1 if answers else 2
        message = messages.of_reader(received)
        if self._unanswered > 0 and isinstance(message, (messages.Image, messages.Raw)):
            # Made for the daemon's own display, before it had read what this one is.
            return None
        if isinstance(message, messages.Event) and message.event == "refused":
            # So that whoever reads on asks again, instead of waiting for what does not come.
            self._disconnect()
            raise Refused(message.message)
        return message

    def _lose(self, error: OSError) -> None:
        """The daemon is gone, or not there yet, or has no place for this client, and says so before it closes."""
        self._gone = str(error) or "taxeld is gone"
        says_why = isinstance(error, _reader.Closed) and error.reason != ""
        self._lost |= bool(self.hello) and not says_why
        self._disconnect()

    def _disconnect(self) -> None:
        reader, self._reader = self._reader, None
        if reader:
            reader.close()
