"""Boards of a hand on real SocketCAN, which a test can unplug, move, double and let babble."""

import os
import socket
import struct
import time

from harness.beside import Beside

FRAME = struct.Struct("=IB3x8s")


class Board:
    """One uSkin board (layout L2): it sends its sweeps once it was started, as the real ones do."""

    def __init__(self, bus, address, rest=9000):
        self.bus = bus
        self.address = address
        self.powered = True
        self.started = False
        self.rest = rest
        self.sweeps = 0

    def reboot(self):
        self.started = False

    def frames(self):
        for k in range(16):
            id = self.address << 8 | (k >> 2) << 4 | k & 3
            z = self.rest + k * 40 + self.sweeps % 7
            yield FRAME.pack(id, 8, struct.pack(">BHHHB", 0x80, 0x8000, 0x7FF0, z, (k >> 2) + 1))
        self.sweeps += 1


class AllegroFingers:
    """An Allegro hand of version 3 that another program has started: each finger's angles, `counts` from the centre."""

    def __init__(self, bus, counts):
        self.bus = bus
        self.counts = counts
        self.address = None  # nothing that a skin's board is told is for it
        self.powered = self.started = True

    def frames(self):
        for finger, counts in enumerate(self.counts):
            yield FRAME.pack(0x3C0 | 2 << 3 | 3 + finger, 8, struct.pack("<4H", *(32768 + c for c in counts)))


class BoardsOnTheBus(Beside):
    """Plays boards. `boards` may be changed at any time."""

    def __init__(self, names, boards, rate_hz=20):
        super().__init__()
        self.names = list(names)
        self.boards = boards
        self.period_s = 1 / rate_hz
        self.sockets = [None] * len(self.names)

    def __exit__(self, *ended):
        super().__exit__(*ended)
        for s in self.sockets:
            if s:
                s.close()

    def run(self):
        # A single CPU, so that frames do not overtake each other in the queues of virtual interfaces.
        os.sched_setaffinity(0, {0})
        turn = 0
        while not self.stop.is_set():
            boards = list(self.boards)
            begin = time.monotonic()
            # Spread over the period, as boards with timers of their own are.
            for i, board in enumerate(boards):
                self._listen()
                self._send(board)
                rest = begin + self.period_s * (i + 1) / len(boards) - time.monotonic()
                if rest > 0:
                    time.sleep(rest)
            turn += 1

    def _socket(self, bus):
        if self.sockets[bus] is None:
            s = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
            try:
                s.bind((self.names[bus],))
                s.setblocking(False)
            except OSError:
                s.close()
                return None
            self.sockets[bus] = s
        return self.sockets[bus]

    def _lost(self, bus):
        self.sockets[bus].close()
        self.sockets[bus] = None

    def _listen(self):
        for bus in range(len(self.names)):
            s = self._socket(bus)
            while s is not None:
                try:
                    id, length, data = FRAME.unpack(s.recv(16))
                except BlockingIOError:
                    break
                except OSError:
                    self._lost(bus)
                    break
                if id >> 4 == 0x20 and length >= 2 and data[0] == 7 and data[1] in (0, 1):
                    for board in list(self.boards):
                        if board.bus == bus and board.powered and board.address in (id & 15, 15):
                            board.started = data[1] == 0

    def _send(self, board):
        s = self._socket(board.bus)
        if s is None or not (board.powered and board.started):
            return
        try:
            for frame in board.frames():
                s.send(frame)
        except OSError:
            self._lost(board.bus)


class Babbler(Beside):
    """A node that sends one id again and again, `rate_hz` times a second however seldom it gets to run."""

    def __init__(self, name, id, rate_hz):
        super().__init__()
        self.socket = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        self.socket.bind((name,))
        self.frame = FRAME.pack(id, 8, b"\xba" * 8)
        self.rate_hz = rate_hz

    def __exit__(self, *ended):
        super().__exit__(*ended)
        self.socket.close()

    def run(self):
        began, sent = time.monotonic(), 0
        while not self.stop.wait(0.003):
            due = int((time.monotonic() - began) * self.rate_hz)
            for _ in range(min(due - sent, 300)):
                try:
                    self.socket.send(self.frame)
                except OSError:
                    break  # the queue is full: the bus is
            sent = due
