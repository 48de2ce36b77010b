#!/usr/bin/env python3
"""Sends the frames of a pressure array to taxeld: those of an .npy (T x rows x columns), again and again, or a bump.

    python3 examples/pressure_array.py /run/taxeld/touch.sock [frames.npy]

Put your sensor into frames(). Needs numpy. SPDX-License-Identifier: Apache-2.0 OR MIT
"""

import itertools
import socket
import struct
import sys
import time

import numpy as np


def frames(file=None, rows=28, columns=50):
    """Endless frames, rows x columns counts each, with the time of measurement, ten a second."""
    y, x = np.mgrid[:rows, :columns]
    bump = [200 * np.exp(-((y - rows / 2) ** 2 + (x - at) ** 2) / 20) for at in range(columns)]
    for frame in itertools.cycle(np.load(file) if file else [0 * bump[0]] * 50 + bump):
        time.sleep(0.1)
        yield frame, time.monotonic_ns()


if len(sys.argv) not in (2, 3):
    sys.exit(f"usage: {sys.argv[0]} SOCKET [FRAMES.npy]; SOCKET is that of pressure:SOCKET in taxeld's configuration")
to = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
for sequence, (frame, t_ns) in enumerate(frames(*sys.argv[2:])):
    head = struct.pack("<4sBxHHHIQ", b"TXPA", 1, *frame.shape, 0, sequence % 2**32, t_ns)
    try:
        to.sendto(head + frame.astype("<u2").tobytes(), sys.argv[1])
    except (FileNotFoundError, ConnectionRefusedError):
        print("taxeld does not run yet", file=sys.stderr)
