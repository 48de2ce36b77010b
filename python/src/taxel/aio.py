"""The same with asyncio: `async for image in taxel.aio.connect():`."""

import asyncio
from typing import Any, AsyncIterator, Dict, Optional, Sequence

from . import _reader, messages
from .stream import RETRY_S, Path, Subscription, wanted


class Stream:
    """The images of a running daemon, across its restarts. Made by `connect`."""

    def __init__(self, subscription: Subscription) -> None:
        self._subscription = subscription
        self._gives_all = bool(subscription.wanted.get("raw") or subscription.wanted.get("status"))
        self._closed = False

    async def __aenter__(self) -> "Stream":
        return self

    async def __aexit__(self, *_exc: object) -> None:
        self.close()

    async def __aiter__(self) -> AsyncIterator[Any]:
        while not self._closed:
            message = await self.message()
            if self._gives_all or isinstance(message, messages.Image):
                yield message

    @property
    def hello(self) -> Dict[str, Any]:
        """The newest description of hand and display (docs/wire.md, "HELLO"); empty before one came."""
        return self._subscription.hello

    @property
    def restarts(self) -> int:
        """How often the daemon went away and came back."""
        return self._subscription.restarts

    async def next(self) -> messages.Image:
        """The next image. `asyncio.wait_for` bounds it; what has come by then is not lost."""
        while True:
            message = await self.message()
            if isinstance(message, messages.Image):
                return message

    async def message(self) -> messages.Message:
        """The next message of any kind. Waits for a daemon that has gone.

        Raises Refused where the daemon refuses the subscription, DecodeError for a bad message.
        """
        subscription = self._subscription
        while True:
            try:
                reader = subscription.open()
                await _readable(reader)
                message = subscription.take(reader, 0.0)
            except PermissionError:
                raise
            except OSError as error:
                subscription.lose(error)
                await asyncio.sleep(RETRY_S)
                continue
            if message is not None:
                return message

    def close(self) -> None:
        """Ends the connection."""
        self._closed = True
        self._subscription.close()


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
    return Stream(Subscription(path, wanted(raw, status, every, max_rate_hz, profile, region)))
