"""Sweeps in, images out, one at a time: each sweep is sent whole and its image awaited before the next.

So nothing depends on the machine's speed, nothing is lost, and image i belongs to sweep i.
"""

import time

import taxel_reader
from harness.daemon import HANGS_AFTER_S

BOARD_PERIOD_S = 0.010
DEADLINE_S = 10.0
# A sweep is complete when every taxel came; the deadline and the silence rule are out of the way.
SWEEP = {
    "board_period_ms": BOARD_PERIOD_S * 1000,
    "deadline_ms": DEADLINE_S * 1000,
    "stale_after_ms": DEADLINE_S * 1000,
    "silent_after_sweeps": 250,
    "settle_ms": 0.0,
}
TABLES = {
    "tick": {"mode": "sweep", "silent_ms": 2000},
    "boards": {"mode": "passive"},
    "sweep": SWEEP,
    "profile": {"method": "paper"},
    "conditioning": {"preset": "robust"},
}


# For who looks at the last image for long: none that tells of silence takes its place.
NEVER_SILENT = {"mode": "sweep", "silent_ms": 60_000}
CALIBRATION_FRAMES = 2


class Overtaken(Exception):
    """A newer image took the place of the awaited one before it was sent, or its sweep was cut by the deadline.

    That is what a daemon shall do that has no time to send, or that gets a sweep too slowly. On a machine so busy that it
    happens here, within the two seconds until an image says that the hand is silent, or the ten of the deadline, the sweep
    has to be sent again.
    """


class Lockstep:
    """Drives one daemon. `sweeps` counts what was sent, sweeps that had to be sent again included."""

    def __init__(self, daemon, buses, hand):
        self.daemon = daemon
        self.hand = hand
        self.buses = buses
        self.reader = taxel_reader.connect(daemon.images)
        self.began_at = self.sent_at = 0.0
        self.sweeps = 0
        # Since a sweep was sent again there may be an image of it from before.
        self.sent_again = False
        self.calibration = []
        # The description of the hand is the first that a reader is sent: from now on the daemon serves it.
        while self.reader.hello is None:
            assert self.reader.receive(HANGS_AFTER_S) is not None, "the daemon does not describe the hand"

    def step(self, counts, order=None):
        """The image of one sweep."""
        frames = self.hand.sweep(counts, order)
        calibrating = len(self.calibration) < CALIBRATION_FRAMES
        if calibrating:
            self.calibration.append(frames)
        for again in range(5):
            try:
                if again:
                    self._wait_for_silence()
                if calibrating and again:  # the first frames are remembered: begin anew
                    self._calibrate_again()
                return self._image_of(frames)
            except Overtaken:
                self.sent_again = True
        raise AssertionError(f"five images in a row were overtaken; status: {self.daemon.status()}")

    def rezero(self):
        """Has the daemon measure its baseline from the next sweeps."""
        assert self.daemon.control("rezero")["ok"]
        self.calibration = []

    def send(self, frames):
        """Sends a sweep, or what there is of it, not so soon that its readings are taken for duplicates."""
        time.sleep(max(0.0, self.sent_at + BOARD_PERIOD_S - time.monotonic()))
        self.began_at = time.monotonic()
        self.buses.send(frames)
        self.sent_at = time.monotonic()
        self.sweeps += 1

    def _image_of(self, frames):
        self.send(frames)
        oldest_s = self.began_at - BOARD_PERIOD_S / 2 if self.sent_again else 0.0
        try:
            return next_full_image(self.reader, sent_from=self.began_at, oldest_s=oldest_s)
        except AssertionError as error:
            raise AssertionError(f"{error}; status: {self.daemon.status()}") from None

    def _wait_for_silence(self):
        """Until nothing of a sweep is under way: the end of one and the beginning of the next would be an image, too."""
        while next_image(self.reader).missing < len(self.hand):
            pass

    def _calibrate_again(self):
        assert self.daemon.control("rezero")["ok"]
        for frames in self.calibration[:-1]:
            self._image_of(frames)


def next_image(reader, seconds=HANGS_AFTER_S):
    """The next image, whatever it shows."""
    end = time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0:
        message = reader.receive(left)
        if isinstance(message, taxel_reader.Image):
            return message
    raise AssertionError(f"no image within {seconds} s")


# The awaited image may have been skipped, or an earlier one that told of silence: after this long it was the former.
OVERTAKEN_S = 1.0


def next_full_image(reader, seconds=HANGS_AFTER_S, sent_from=None, oldest_s=0.0):
    """The next image in which no taxel is missing; while nothing is sent the daemon says so with empty ones. One whose newest
    reading came before `oldest_s` is of another sweep.

    `sent_from` is when the first frame of its sweep was sent, if that is to be sent again where the deadline cut it. Both
    parts then come as images; of a sweep of which the daemon lost something there is one.
    """
    end = time.monotonic() + seconds
    overtaken_at = float("inf")
    missing = []
    while time.monotonic() < end:
        image = next_image(reader)
        if image.missing == 0:
            if image.header.t_ns >= 1e9 * oldest_s:
                return image
            continue
        if sent_from is not None and image.header.t_ns < 1e9 * (sent_from - BOARD_PERIOD_S / 2):
            continue  # of what was sent before
        if image.skipped:
            overtaken_at = min(overtaken_at, time.monotonic() + OVERTAKEN_S)
        if time.monotonic() > overtaken_at:
            raise Overtaken
        missing.append(image.missing)
        parts = sum(0 < m < len(reader.hello["taxels"]) for m in missing)
        if sent_from is not None and time.monotonic() > sent_from + DEADLINE_S and parts > 1:
            raise Overtaken
    raise AssertionError(f"only incomplete images within {seconds} s, which lacked {missing} taxels")
