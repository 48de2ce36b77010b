"""Sweeps in, images out, one at a time: each sweep is sent whole and its image awaited before the next.

So nothing depends on the machine's speed, nothing is lost, and image i belongs to sweep i.
"""

import time

import taxel_reader

BOARD_PERIOD_S = 0.010
# A sweep is complete when every taxel came; the deadline and the silence rule are out of the way.
SWEEP = {
    "board_period_ms": BOARD_PERIOD_S * 1000,
    "deadline_ms": 5000.0,
    "stale_after_ms": 5000.0,
    "silent_after_sweeps": 250,
    "settle_ms": 0.0,
}
TABLES = {"tick": {"mode": "sweep"}, "boards": {"mode": "passive"}, "sweep": SWEEP}


class Lockstep:
    def __init__(self, daemon, buses, hand):
        self.hand = hand
        self.buses = buses
        self.reader = taxel_reader.connect(daemon.images)
        self.sent_at = 0.0
        # The hand is silent, and the daemon says so: from now on it serves this reader.
        next_image(self.reader)

    def step(self, counts, order=None):
        """The image of one sweep."""
        self.send(self.hand.sweep(counts, order))
        return next_full_image(self.reader)

    def send(self, frames):
        """Sends a sweep, or what there is of it, not so soon that its readings are taken for duplicates."""
        time.sleep(max(0.0, self.sent_at + BOARD_PERIOD_S - time.monotonic()))
        self.buses.send(frames)
        self.sent_at = time.monotonic()


def next_image(reader, seconds=10.0):
    """The next image, whatever it shows."""
    end = time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0:
        message = reader.receive(left)
        if isinstance(message, taxel_reader.Image):
            return message
    raise AssertionError(f"no image within {seconds} s")


def next_full_image(reader, seconds=10.0):
    """The next image in which no taxel is missing; while nothing is sent the daemon says so with empty ones."""
    end = time.monotonic() + seconds
    missing = []
    while time.monotonic() < end:
        image = next_image(reader)
        if image.missing == 0:
            return image
        missing.append(image.missing)
    raise AssertionError(f"only incomplete images within {seconds} s, which lacked {missing} taxels")
