"""The same with asyncio: `async for image in taxel.aio.connect():`."""

import asyncio
import contextlib
from typing import Any, AsyncIterator, Dict, Optional, Sequence

from . import _reader, messages
from .arguments import Path, wanted
from .subscription import RETRY_S, Subscription


class Stream(Subscription):
    """The images of a running daemon, across its restarts. Made by `connect`."""

    async def __aenter__(self) -> "Stream":
        return self

    async def __aexit__(self, *_exc: object) -> None:
        self.close()

    async def __aiter__(self) -> AsyncIterator[Any]:
        """Images; with raw or status every message. Ends when the stream is closed."""
        while not self._closed:
            message = await self.message()
            if message is not None and (self._gives_all or isinstance(message, messages.Image)):
                yield message

    async def next(self) -> Optional[messages.Image]:
        """The next image; None where the stream was closed.

        `asyncio.wait_for` bounds it; what has come by then is not lost.
        """
        while not self._closed:
            message = await self.message()
            if isinstance(message, messages.Image):
                return message
        return None

    async def message(self) -> Optional[messages.Message]:
        """The next message of any kind; None where the stream was closed. Waits for a daemon that has gone.

        Raises Refused where the daemon refuses the subscription, DecodeError for a bad message, RuntimeError where
        another task is reading.
        """
        with self._reading():
            while not self._closed:
                try:
                    reader = await self._connected()
                    if reader is None:
                        break
                    await _readable(reader)
                    message = self._take(0.0)
                except PermissionError:
                    raise
                except OSError as error:
                    if self._closed:
                        break
                    self._lose(error)
                    await asyncio.sleep(RETRY_S)
                    continue
                if message is not None:
                    return message
        return None

    async def _connected(self) -> Optional["_reader.Reader"]:
        """The connection, made where there is none; None where the stream was closed meanwhile."""
        with contextlib.closing(self._connecting()) as attempts:
            for seconds in attempts:
                await asyncio.sleep(seconds)
                if self._closed:
                    return None
        return self._reader


async def _readable(reader: "_reader.Reader") -> None:
    """Waits until a packet, or the end, is there."""
    loop = asyncio.get_running_loop()
    there: "asyncio.Future[None]" = loop.create_future()
    descriptor = reader.fileno()

    def wake() -> None:
        if not there.done():
            there.set_result(None)

    loop.add_reader(descriptor, wake)
    try:
        await there
    finally:
        loop.remove_reader(descriptor)


def connect(
    path: Optional[Path] = None,
    *,
    raw: bool = False,
    status: bool = False,
    every: bool = False,
    max_rate_hz: Optional[float] = None,
    profile: Optional[Dict[str, Any]] = None,
    region: Optional[Sequence[str]] = None,
) -> Stream:
    """As `taxel.connect`, but a daemon that does not run yet is waited for."""
    return Stream(path, wanted(raw, status, every, max_rate_hz, profile, region))
