"""A daemon that sends what a test tells it to."""

import collections
import contextlib
import functools
import json
import os
import selectors
import shutil
import socket
import struct
import tempfile
import threading
import time
from pathlib import Path
from typing import Any, Callable, Deque, Dict, Iterable, Iterator, List, Optional, Sequence, Set, Tuple

import numpy as np

from . import _reader, messages, refusal


PATIENCE_S = 10.0
"""What a subscriber may take to connect, to subscribe, or to read where it is sent more than a socket holds."""

_SUBSCRIPTION = {"image": True, "raw": False, "status": False, "every": False, "max_rate_hz": None}
"""The subscription of a client that states nothing."""


def encode_image(image: messages.Image) -> bytes:
    """An IMAGE message, header and payload (docs/wire.md, "IMAGE")."""
    sections = struct.pack(
        "<6H3I",
        image.width,
        image.height,
        len(image.levels),
        len(image.actuators),
        len(image.joints),
        24,
        image.contacts,
        image.faulty,
        image.missing,
    )
    sections += image.levels.astype("<f4").tobytes()
    sections += np.asarray(image.actuators, messages.ACTUATOR).tobytes()
    sections += image.joints.astype("<f4").tobytes()
    sections += image.pixels.astype(np.uint8).tobytes()
    sections += bytes(-len(sections) % 4)
    return _message(_reader.IMAGE, sections, image.flags, image.seq, image.t_ns, image.skipped)


def _message(kind: int, payload: bytes, flags: int = 0, seq: int = 0, t_ns: int = 0, skipped: int = 0) -> bytes:
    head = (_reader.MAGIC, _reader.MAJOR, _reader.MINOR, _reader.HEADER_LEN, kind, flags, len(payload))
    return struct.pack("<4sBBHHHIQQII", *head, seq, t_ns, skipped, 0) + payload


def _event(event: str, message: str, seq: int = 0) -> bytes:
    return _message(_reader.EVENT, json.dumps({"event": event, "message": message}).encode(), seq=seq)


class FakeDaemon:
    """Listens as taxeld does, on `path` for images and on `control` for requests. Use it as a context.

    An image goes to all who are connected when it is made, or else to whoever connects next: so a test of one thread
    may press before its driver is back after a restart. It is the same for every display; nothing is compressed.
    `subscriptions` are the SUBSCRIBE messages that came, `requests` the requests; `answer` makes the reply to a
    request, by default `{"ok": true}` with an empty status or profile. What taxeld refuses is refused, as far as it
    can be told without a hand. It knows no other programs: whoever asks may drive what is held.
    """

    def __init__(
        self, width: int = 4, height: int = 4, levels: int = 8, actuators: int = 16, joints: Sequence[str] = ()
    ) -> None:
        no = refusal.of_profile({"levels": levels, "actuators": actuators})
        if no:
            raise ValueError(no)
        self.folder = Path(tempfile.mkdtemp(prefix="taxel-fake-"))
        self.path = self.folder / "images.sock"
        self.control = self.folder / "control.sock"
        self.shape = (height, width)
        self.levels = np.arange(1, levels + 1).astype(np.float64) * 100.0
        self.seq = 0
        self.hello: Dict[str, Any] = {
            "protocol": {"major": _reader.MAJOR, "minor": _reader.MINOR},
            "daemon": "a fake taxeld",
            "layout": "fake",
            "width": width,
            "height": height,
            "modules": [],
            "taxels": [],
            "absent": [],
            "profile": {"levels": levels, "actuators": actuators, "method": "optimal", "grey": "level"},
            "rate": {"mode": "timer", "hz": 30.0},
            "force_unit": "counts",
            "clock": "CLOCK_MONOTONIC",
            "subscription": dict(_SUBSCRIPTION),
        }
        if joints:
            self.hello["joints"] = list(joints)
        self.subscriptions: List[Dict[str, Any]] = []
        self.requests: List[Dict[str, Any]] = []
        self.refuses: Optional[str] = None
        """Why the next subscriptions are refused; None to take them."""
        self.answers = True
        """Whether subscriptions are answered; those that come meanwhile are once it is true again."""
        self.answer: Callable[[Dict[str, Any]], Dict[str, Any]] = _agree
        self._changed = threading.Condition()
        self._clients: Dict[socket.socket, Sequence[bytes]] = {}
        """Who is connected, each with the images that it was sent before it could say what it is."""
        self._askers: Set[socket.socket] = set()
        self._holds: Dict[str, Tuple[socket.socket, float]] = {}
        """Who holds a motor, and for how long it may be silent, milliseconds."""
        self._kept: Deque[bytes] = collections.deque(maxlen=100)
        """The newest images that were made while nobody was connected."""
        self._ready: Optional[selectors.BaseSelector] = None
        """Who has something to be read, and what then; None while stopped."""
        self.start()

    def __enter__(self) -> "FakeDaemon":
        return self

    def __exit__(self, *_exc: object) -> None:
        self.stop()
        shutil.rmtree(self.folder, ignore_errors=True)

    def start(self) -> None:
        """Listens, as a daemon that was started."""
        self._ready = selectors.DefaultSelector()
        kinds = ((self.path, socket.SOCK_SEQPACKET, self._subscriber), (self.control, socket.SOCK_STREAM, self._asker))
        for path, kind, take in kinds:
            listener = socket.socket(socket.AF_UNIX, kind)
            listener.bind(os.fspath(path))
            listener.listen()
            self._ready.register(listener, selectors.EVENT_READ, functools.partial(take, self._ready, listener))
        self._thread = threading.Thread(target=self._serve, args=(self._ready,), daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Ends every connection and listens no more, as a daemon that ended."""
        with self._changed:
            ready, self._ready = self._ready, None
            self._clients.clear()
            self._kept.clear()
            self._holds.clear()
            askers = [*self._askers]
        if ready is None:
            return
        ends: List[Any] = [key.fileobj for key in ready.get_map().values()]
        for end in (*askers, *ends):
            # Wakes the thread that waits for it; closing alone does not.
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
        self._thread.join()
        for end in ends:
            end.close()
        ready.close()
        for path in (self.path, self.control):
            path.unlink(missing_ok=True)

    def restart(self) -> None:
        """As a daemon that is updated: connections end, numbers begin again, and it listens as before."""
        self.stop()
        self.seq = 0
        self.start()

    def wait_for_subscribers(self, count: int = 1, timeout: float = PATIENCE_S) -> None:
        """Waits until so many are connected. Raises TimeoutError."""
        with self._changed:
            if not self._changed.wait_for(lambda: len(self._clients) >= count, timeout):
                raise TimeoutError(f"{len(self._clients)} of {count} subscribers after {timeout} s")

    def wait_for_subscription(self, count: int = 1, timeout: float = PATIENCE_S) -> None:
        """Waits until so many SUBSCRIBE messages have come. Raises TimeoutError."""
        with self._changed:
            if not self._changed.wait_for(lambda: len(self.subscriptions) >= count, timeout):
                raise TimeoutError(f"{len(self.subscriptions)} of {count} subscriptions after {timeout} s")

    @property
    def held(self) -> Dict[str, float]:
        """The motors that connections hold (`hold_ms`), and for how long each of these may be silent, milliseconds."""
        with self._changed:
            return {joint: hold_ms for joint, (_, hold_ms) in self._holds.items()}

    def wait_until_held(self, *joints: str, timeout: float = PATIENCE_S) -> None:
        """Waits until these motors are held, and no others; without one, until all were let go. Raises TimeoutError."""
        with self._changed:
            if not self._changed.wait_for(lambda: {*joints} == {*self._holds}, timeout):
                raise TimeoutError(f"held are {sorted(self._holds)} after {timeout} s, instead of {sorted(joints)}")

    def press(self, pressed: Iterable[Tuple[int, int, int]] = (), joints: Sequence[float] = ()) -> messages.Image:
        """Sends an image in which actuators 0, 1, .. press at (x, y) with a level from 1; returns it.

        Raises ValueError where no display that HELLO describes could.
        """
        pressed, most = list(pressed), self.hello["profile"]["actuators"]
        if len(pressed) > most:
            raise ValueError(f"{len(pressed)} actuators press, and the display has {most}")
        height, width = self.shape
        for x, y, level in pressed:
            if not (0 <= x < width and 0 <= y < height and 1 <= level <= len(self.levels)):
                kind = f"{width} x {height} pixels and {len(self.levels)} levels"
                raise ValueError(f"({x}, {y}, {level}) presses where the image has no place: it has {kind}")
        rows = [(n, x, y, level, self.levels[level - 1]) for n, (x, y, level) in enumerate(pressed)]
        pixels = np.zeros(self.shape, np.uint8)
        for _, x, y, level, _ in rows:
            pixels[y, x] = int(255 * level / len(self.levels) + 0.5)
        image = messages.Image(
            seq=self.seq,
            t_ns=time.clock_gettime_ns(time.CLOCK_MONOTONIC),
            pixels=pixels,
            levels=self.levels[: len(self.levels) if rows else 0],
            actuators=messages.actuators(rows),
            joints=np.array(joints, np.float32),
            contacts=len(rows),
            faulty=0,
            missing=0,
        )
        packet = encode_image(image)
        with self._changed:
            clients = self._connected()
            if not clients:
                self._kept.append(packet)
        self._send(clients, packet)
        self.seq += 1
        return image

    def event(self, event: str, message: str) -> None:
        """Sends an EVENT, as `send` does."""
        self.send(_event(event, message, self.seq))

    def send(self, packet: bytes) -> None:
        """Sends bytes to all who are connected, once at least one is."""
        self._connected()
        self.wait_for_subscribers()
        self._send(self._connected(), packet)

    def _connected(self) -> List[socket.socket]:
        """Who is connected by now, each with its answer."""
        with self._changed:
            if self._ready is None:
                raise RuntimeError("the fake daemon is stopped, and sends nothing")
            self._attend(self._ready)
            return list(self._clients)

    @staticmethod
    def _send(clients: Iterable[socket.socket], packet: bytes) -> None:
        for client in clients:
            try:
                client.send(packet, socket.MSG_NOSIGNAL)
            except socket.timeout:
                raise TimeoutError(f"a subscriber has read nothing for {PATIENCE_S} s, and no more fits in") from None
            except OSError:
                # It has gone; reading finds so.
                pass

    def _serve(self, ready: selectors.BaseSelector) -> None:
        while True:
            ready.select()
            with self._changed:
                if self._ready is not ready:
                    return
                self._attend(ready)
            if not self.answers:
                time.sleep(0.01)

    def _attend(self, ready: selectors.BaseSelector) -> None:
        """Takes in who has connected, and answers who has asked; with the lock."""
        while keys := [key for key, _ in ready.select(0) if self.answers or key.fileobj not in self._clients]:
            for key in keys:
                key.data()

    def _subscriber(self, ready: selectors.BaseSelector, listener: socket.socket) -> None:
        client, _ = listener.accept()
        client.settimeout(PATIENCE_S)
        first = [*self._kept]
        self._kept.clear()
        for packet in (_message(_reader.HELLO, json.dumps(self.hello).encode()), *first):
            self._send([client], packet)
        self._clients[client] = first
        ready.register(client, selectors.EVENT_READ, functools.partial(self._subscription, ready, client))
        self._changed.notify_all()

    def _subscription(self, ready: selectors.BaseSelector, client: socket.socket) -> None:
        try:
            packet = client.recv(_reader.MAX_MESSAGE)
            asked = json.loads(packet[_reader.HEADER_LEN :])
        except (OSError, ValueError):
            # It has gone, or sent what is no message.
            ready.unregister(client)
            del self._clients[client]
            client.close()
            return
        no = self.refuses or refusal.of_subscription(asked, _SUBSCRIPTION)
        answer = _event("refused", no) if no else _message(_reader.HELLO, json.dumps(self._hello_of(asked)).encode())
        # Before the answer: who has read it may look.
        self.subscriptions.append(asked)
        # What came before the answer was made for another display, and is passed over: so once more.
        for message in (answer, *self._clients[client]):
            self._send([client], message)
        self._clients[client] = ()
        self._changed.notify_all()

    def _hello_of(self, asked: Dict[str, Any]) -> Dict[str, Any]:
        """The answer to a subscription: what is in force then."""
        hello = {**self.hello, "subscription": {key: asked.get(key, value) for key, value in _SUBSCRIPTION.items()}}
        hello["profile"] = {**self.hello["profile"], **(asked.get("profile") or {})}
        return {**hello, "region": asked["region"]} if asked.get("region") else hello

    def _asker(self, _ready: selectors.BaseSelector, listener: socket.socket) -> None:
        client, _ = listener.accept()
        self._askers.add(client)
        threading.Thread(target=self._answers_to, args=(client,), daemon=True).start()

    def _answers_to(self, client: socket.socket) -> None:
        with client:
            with contextlib.suppress(OSError):
                for line in self._asked(client):
                    answer = self._answered(client, line)
                    client.sendall(json.dumps(answer).encode() + b"\n")
                    if answer.get("ask_again"):  # it has made room
                        break
            with self._changed:
                self._askers.discard(client)
                for joint in [joint for joint, (holder, _) in self._holds.items() if holder is client]:
                    del self._holds[joint]
                self._changed.notify_all()

    def _asked(self, client: socket.socket) -> Iterator[bytes]:
        """What it asks, until it has gone, or holds motors and is silent for too long."""
        received, since = b"", time.monotonic()
        while True:
            line, end, rest = received.partition(b"\n")
            if end:
                received = rest
                if line.strip():
                    yield line
                    since = time.monotonic()
                continue
            with self._changed:
                held_ms = [ms for holder, ms in self._holds.values() if holder is client]
            left = since + min(held_ms) / 1e3 - time.monotonic() if held_ms else None
            if left is not None and left <= 0:
                error = f"nothing was asked for {min(held_ms):g}ms, so the motors that this connection held are switched off"
                client.sendall(json.dumps({"ok": False, "error": error}).encode() + b"\n")
                return
            client.settimeout(left)
            with contextlib.suppress(socket.timeout):
                part = client.recv(1 << 16)
                if not part:
                    return
                received += part

    def _answered(self, client: socket.socket, line: bytes) -> Dict[str, Any]:
        try:
            request = json.loads(line)
        except ValueError as error:
            return {"ok": False, "error": f"no JSON object: {error}"}
        self.requests.append(request)
        answer = self.answer(request)
        if answer.get("ok") and request.get("torque") is not None:
            joint, hold_ms = request["joint"], request.get("hold_ms")
            with self._changed:
                if hold_ms or not request["torque"]:
                    self._holds.pop(joint, None)
                if hold_ms:
                    self._holds[joint] = client, hold_ms
                self._changed.notify_all()
        return answer


def _agree(request: Dict[str, Any]) -> Dict[str, Any]:
    error = refusal.of_request(request)
    if error:
        return {"ok": False, "error": error}
    said: Dict[str, Dict[str, Any]] = {"status": {"status": {}}, "mark": {"mark": {"seq": 0, "t_ns": 0}}}
    if request == {"cmd": "profile"}:
        return {"ok": True, "profile": {}}
    return {"ok": True, **said.get(request["cmd"], {})}
