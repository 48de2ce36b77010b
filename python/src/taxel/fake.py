"""A daemon that sends what a test tells it to."""

import json
import os
import shutil
import socket
import struct
import tempfile
import threading
import time
from pathlib import Path
from typing import Any, Callable, Dict, Iterable, List, Optional, Sequence, Tuple

import numpy as np

from . import _reader, messages


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


class FakeDaemon:
    """Listens as taxeld does, on `path` for images and on `control` for requests. Use it as a context.

    Each image is sent to all who are connected when it is made; connecting and subscribing are waited for by
    `wait_for_subscribers`. `subscriptions` are the SUBSCRIBE messages that came, `requests` the requests; `answer`
    makes the reply to a request, by default `{"ok": true}` with an empty status or profile.
    """

    def __init__(
        self, width: int = 4, height: int = 4, levels: int = 8, actuators: int = 16, joints: Sequence[str] = ()
    ) -> None:
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
        self._clients: List[socket.socket] = []
        self._listeners: List[socket.socket] = []
        self.start()

    def __enter__(self) -> "FakeDaemon":
        return self

    def __exit__(self, *_exc: object) -> None:
        self.stop()
        shutil.rmtree(self.folder, ignore_errors=True)

    def start(self) -> None:
        """Listens, as a daemon that was started."""
        kinds = ((self.path, socket.SOCK_SEQPACKET, self._subscriber), (self.control, socket.SOCK_STREAM, self._asker))
        for path, kind, serve in kinds:
            listener = socket.socket(socket.AF_UNIX, kind)
            listener.bind(os.fspath(path))
            listener.listen()
            self._listeners.append(listener)
            threading.Thread(target=self._accept, args=(listener, serve), daemon=True).start()

    def stop(self) -> None:
        """Ends every connection and listens no more, as a daemon that ended."""
        for listener in self._listeners:
            # Wakes the thread that accepts; closing alone does not.
            listener.shutdown(socket.SHUT_RDWR)
            listener.close()
        self._listeners = []
        with self._changed:
            clients, self._clients = self._clients, []
        for client in clients:
            client.shutdown(socket.SHUT_RDWR)
        for path in (self.path, self.control):
            path.unlink(missing_ok=True)

    def restart(self) -> None:
        """As a daemon that is updated: connections end, numbers begin again, and it listens as before."""
        self.stop()
        self.seq = 0
        self.start()

    def wait_for_subscribers(self, count: int = 1, timeout: float = 10.0) -> None:
        """Waits until so many are connected. Raises TimeoutError."""
        with self._changed:
            if not self._changed.wait_for(lambda: len(self._clients) >= count, timeout):
                raise TimeoutError(f"{len(self._clients)} of {count} subscribers after {timeout} s")

    def wait_for_subscription(self, count: int = 1, timeout: float = 10.0) -> None:
        """Waits until so many SUBSCRIBE messages have come. Raises TimeoutError."""
        with self._changed:
            if not self._changed.wait_for(lambda: len(self.subscriptions) >= count, timeout):
                raise TimeoutError(f"{len(self.subscriptions)} of {count} subscriptions after {timeout} s")

    def press(self, pressed: Iterable[Tuple[int, int, int]] = (), joints: Sequence[float] = ()) -> messages.Image:
        """Sends an image in which actuators 0, 1, .. press at (x, y) with a level from 1; returns it."""
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
        self.send(encode_image(image))
        self.seq += 1
        return image

    def event(self, event: str, message: str) -> None:
        """Sends an EVENT."""
        self.send(_message(_reader.EVENT, json.dumps({"event": event, "message": message}).encode(), seq=self.seq))

    def send(self, packet: bytes) -> None:
        """Sends bytes to all who are connected, once at least one is."""
        self.wait_for_subscribers()
        with self._changed:
            clients = list(self._clients)
        for client in clients:
            try:
                client.send(packet, socket.MSG_NOSIGNAL)
            except OSError:
                pass

    def _accept(self, listener: socket.socket, serve: Callable[[socket.socket], None]) -> None:
        while True:
            try:
                client, _ = listener.accept()
            except OSError:
                return
            threading.Thread(target=serve, args=(client,), daemon=True).start()

    def _subscriber(self, client: socket.socket) -> None:
        hello = _message(_reader.HELLO, json.dumps(self.hello).encode())
        try:
            client.send(hello, socket.MSG_NOSIGNAL)
            with self._changed:
                self._clients.append(client)
                self._changed.notify_all()
            while packet := client.recv(_reader.MAX_MESSAGE):
                asked = json.loads(packet[_reader.HEADER_LEN :])
                while not self.answers:
                    time.sleep(0.01)
                refusal = {"event": "refused", "message": self.refuses}
                kind, reply = (_reader.EVENT, refusal) if self.refuses else (_reader.HELLO, self._hello_of(asked))
                client.send(_message(kind, json.dumps(reply).encode()), socket.MSG_NOSIGNAL)
                with self._changed:
                    self.subscriptions.append(asked)
                    self._changed.notify_all()
        except OSError:
            pass
        with self._changed:
            if client in self._clients:
                self._clients.remove(client)
        client.close()

    def _hello_of(self, asked: Dict[str, Any]) -> Dict[str, Any]:
        """The answer to a subscription: what is in force then."""
        hello = {**self.hello, "subscription": {key: asked.get(key, value) for key, value in _SUBSCRIPTION.items()}}
        if "profile" in asked:
            hello["profile"] = {**self.hello["profile"], **asked["profile"]}
        return {**hello, "region": asked["region"]} if "region" in asked else hello

    def _asker(self, client: socket.socket) -> None:
        with client, client.makefile("rwb") as lines:
            for line in lines:
                request = json.loads(line)
                self.requests.append(request)
                lines.write(json.dumps(self.answer(request)).encode() + b"\n")
                lines.flush()


def _agree(request: Dict[str, Any]) -> Dict[str, Any]:
    said: Dict[str, Dict[str, Any]] = {"status": {"status": {}}, "mark": {"mark": {"seq": 0, "t_ns": 0}}}
    if request == {"cmd": "profile"}:
        return {"ok": True, "profile": {}}
    return {"ok": True, **said.get(str(request.get("cmd")), {})}
