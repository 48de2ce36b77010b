"""The same with asyncio: `async for image in taxel.aio.connect():`, `await taxel.aio.Control().rezero()`."""

import asyncio
import contextlib
import os
import socket
from typing import Any, AsyncIterator, Dict, Mapping, Optional, Sequence

from . import _reader, messages, requests
from .arguments import Path, wanted
from .requests import Mark
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


class Control:
    """As `taxel.Control`, each method to be awaited and the context one of `async with`, of any number of tasks.

    A request that is given up, as by `asyncio.wait_for`, ends its connection, too.
    """

    def __init__(self, path: Optional[Path] = None, timeout: float = 10.0) -> None:
        self.path = None if path is None else os.fsdecode(path)
        self.timeout = timeout
        self._held: Optional[_Connection] = None

    async def __aenter__(self) -> "Control":
        if self._held:
            raise RuntimeError("it is used as a context already; make another Control")
        self._held = await _Connection.to(requests.place(self.path), self.timeout)
        return self

    async def __aexit__(self, *_exc: object) -> None:
        held, self._held = self._held, None
        if held:
            held.close()

    async def status(self) -> Dict[str, Any]:
        """Everything the daemon knows of itself and the hand."""
        return dict((await self.request(requests.STATUS))["status"])

    async def profile(self) -> Dict[str, Any]:
        """The display profile of subscribers that state none."""
        return dict((await self.request(requests.PROFILE))["profile"])

    async def set_profile(self, profile: Dict[str, Any]) -> None:
        """Replaces that profile; keys left out take their defaults."""
        await self.request({"cmd": "profile", "profile": profile})

    async def rezero(self) -> None:
        """Measures the baseline anew; the hand must not be touched meanwhile."""
        await self.request({"cmd": "rezero"})

    async def pause(self) -> None:
        """Shows no contact until `resume`, so that every display lets go."""
        await self.request({"cmd": "pause"})

    async def resume(self) -> None:
        """Shows contacts again."""
        await self.request({"cmd": "resume"})

    async def mark(self, text: str) -> Mark:
        """Tells every subscriber and recorder that something happened now; 1 to 500 bytes."""
        return requests.mark_of(await self.request({"cmd": "mark", "text": text}))

    async def torque(
        self, joint: str, on: bool, *, pwm_percent: Optional[float] = None, hold_ms: Optional[float] = None
    ) -> None:
        """As `taxel.Control.torque`; `hold_ms` in `async with` alone."""
        await self.request(requests.torque(joint, on, pwm_percent, hold_ms))

    async def keep_alive(self) -> None:
        """As `taxel.Control.keep_alive`."""
        await self.request(requests.PROFILE)

    async def pwm(self, joint: str, percent: float) -> None:
        """Gives a servo a PWM, -100 to 100 percent, where `allow_writes = true` and its torque is on."""
        await self.request({"cmd": "servo", "joint": joint, "pwm_percent": percent})

    async def pwm_together(self, percent: Mapping[str, float]) -> None:
        """The same for several servos, by their joints, at one instant; all or none."""
        await self.request(requests.pwm_together(percent))

    async def request(self, request: Dict[str, Any]) -> Dict[str, Any]:
        """Sends one request and returns the answer (docs/wire.md, "The control socket")."""
        held = self._held
        line = requests.encode(request, held is not None)
        if held:
            reply = await held.ask(request, line)
            if not requests.is_to_be_asked_elsewhere(request, reply):
                return requests.decode(reply, held.path)
        for _ in range(requests.TRIES):
            place = requests.place(self.path, request)
            with contextlib.closing(await _Connection.to(place, self.timeout)) as connection:
                reply = await connection.ask(request, line)
            if not requests.is_to_be_asked_again(reply):
                break
        return requests.decode(reply, connection.path)


class _Connection:
    def __init__(self, connection: socket.socket, path: str, timeout: float) -> None:
        self.path = path
        self._timeout = timeout
        self._socket = connection
        self._alone = asyncio.Lock()
        self._has_ended = False

    @classmethod
    async def to(cls, path: str, timeout: float) -> "_Connection":
        # Not by asyncio's own, which takes a socket for connected where there is no room for the connection.
        connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            for seconds in _reader.attempts(connection, path, timeout):
                await asyncio.sleep(seconds)
        except BaseException as error:
            connection.close()
            if isinstance(error, OSError):
                raise requests.no_daemon(error, path) from None
            raise
        return cls(connection, path, timeout)

    async def ask(self, request: Dict[str, Any], line: bytes) -> bytes:
        """The reply, nothing where the connection has ended. A time-out ends it: the next would be given its reply."""
        async with self._alone:
            if self._has_ended:
                return requests.reply_behind_the_end(request, self.path)
            reply = b""
            try:
                reply = await asyncio.wait_for(self._reply_to(line), self._timeout)
            except asyncio.TimeoutError:
                raise requests.unanswered(request, self.path, self._timeout) from None
            finally:
                if self._has_ended or not reply:
                    self._has_ended = True
                    self._socket.close()
            return reply

    async def _reply_to(self, line: bytes) -> bytes:
        loop = asyncio.get_running_loop()
        # What has closed the connection may have said why.
        with contextlib.suppress(ConnectionError):
            await loop.sock_sendall(self._socket, line)
        reply = bytearray()
        with contextlib.suppress(ConnectionError):
            while not reply.endswith(b"\n"):
                part = await loop.sock_recv(self._socket, 1 << 16)
                if not part:
                    break
                reply += part
        return bytes(reply)

    def close(self) -> None:
        """Ends it, and whoever waits for a reply, who must not be left with a descriptor that is closed."""
        self._has_ended = True
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        if not self._alone.locked():
            self._socket.close()
