"""A received image against the reference's."""

import numpy as np
import taxel_reader
from conditioning import Conditioner
from harness.daemon import HANGS_AFTER_S
from sequential_clustering import Profile, compress

# The age of a taxel without a value.
NEVER_US = 2**32 - 1


class Reference:
    """The publication from counts to image, frame by frame."""

    def __init__(self, hand, profile):
        self.hand = hand
        self.profile = profile
        self.conditioner = Conditioner()

    @property
    def is_calibrating(self):
        return self.conditioner.threshold is None

    def image_of(self, raw):
        """Of a RAW message."""
        missing = np.array([t.freshness != 2 for t in raw.taxels])
        return self.image(np.array([t.counts for t in raw.taxels]), missing)

    def image(self, counts, missing=None):
        missing = np.zeros(len(self.hand), dtype=bool) if missing is None else missing
        force, self.contact, faulty = self.conditioner.feed(counts, missing)
        return compress(force, self.contact, faulty, missing, self.hand.xy, self.hand.shape, self.profile)


def sampled_us(raw):
    """When each taxel of a RAW message was sampled; microseconds of the daemon's clock."""
    age_us = np.array([t.age_us for t in raw.taxels])
    return np.where(age_us == NEVER_US, -np.inf, raw.header.t_ns / 1000 - age_us)


def assert_same(image, expected, where):
    """Every byte of the image, every level and every actuator. Forces travel as single precision."""
    pixels = np.frombuffer(image.pixels, np.uint8).reshape(image.height, image.width)
    got, want = (image.contacts, image.missing), (expected.contacts, expected.missing)
    assert got == want, f"{where}: {got} contacts and missing taxels, not {want}"
    # Which taxels are faulty is told when the calibration is done.
    assert image.calibrating or image.faulty == expected.faulty, f"{where}: {image.faulty} faulty, not {expected.faulty}"
    assert not (image.calibrating and expected.contacts), where
    assert list(image.levels) == [float(np.float32(f)) for f in expected.levels], where
    got = [(a.id, a.x, a.y, a.level, a.force) for a in image.actuators]
    want = [(*a[:4], float(np.float32(a[4]))) for a in expected.actuators]
    assert got == want, f"{where}: actuators are {sorted({*got} - {*want})}, not {sorted({*want} - {*got})}"
    assert np.array_equal(pixels, expected.pixels), f"{where}: pixels differ at {np.argwhere(pixels != expected.pixels)}"


def pairs(reader):
    """The image and the raw counts of each tick, of a reader of every one."""
    images, raws = {}, {}
    while True:
        message = reader.receive(HANGS_AFTER_S)
        assert message is not None, "the daemon sends nothing more"
        if isinstance(message, taxel_reader.Image):
            images[message.seq] = message
        elif isinstance(message, taxel_reader.Raw):
            raws[message.header.seq] = message
        for seq in images.keys() & raws.keys():
            yield images.pop(seq), raws.pop(seq)


def content(image):
    """What must be the same when the same recording is played again: everything but the header."""
    return image._replace(header=None)


def fits_the_counts(daemon, reader, hand, enough):
    """Compares each image of a hand that moves with its counts, until more than `enough` of them show a touch.

    It is calibrated when it is whole, on two frames that both come here and have a new value of each taxel: on a busy
    machine its boards do not come up within ten frames, and are held up now and then.
    """
    reference, before, begins_at, whole, touched = None, None, 0, 0, 0
    for image, raw in pairs(reader):
        follows = before is not None and image.seq == before.header.seq + 1
        begins = reference is None and image.calibrating and image.seq >= begins_at
        calibrates = begins or reference is not None and reference.is_calibrating
        if (reference is None and not follows) or (calibrates and not (follows and all_new(raw, before))):
            begins_at, reference = calibrates_from(daemon, begins_at), None
        elif begins:
            reference = Reference(hand, Profile())
        if reference:
            assert_same(image, reference.image_of(raw), f"image {image.seq}")
            assert [t.contact for t in raw.taxels] == list(reference.contact), f"contacts of frame {image.seq}"
            whole += image.missing == 0
            touched += image.contacts > 0
        before = raw
        if whole > 80 and touched > enough:
            return


def all_new(raw, before):
    """Whether each taxel has been sampled since the frame before."""
    # Ages are whole microseconds; samples of a taxel are milliseconds apart.
    return np.all(sampled_us(raw) > sampled_us(before) + 100)


def calibrates_from(daemon, before):
    """Has a whole hand calibrated anew; no image before this one is of that calibration. `before`: the same of the last one."""

    def is_whole(status):
        # What it was told then it has begun by now.
        return status["images"]["made"] > before + 3 and not status["calibrating"] and status["missing"] == 0

    status = daemon.wait_status(is_whole, "the hand is not whole")
    assert daemon.control("rezero")["ok"]
    return status["images"]["made"]
