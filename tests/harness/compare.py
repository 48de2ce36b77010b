"""A received image against the reference's."""

import numpy as np
import taxel_reader
from conditioning import Conditioner
from sequential_clustering import compress


class Reference:
    """The publication from counts to image, frame by frame."""

    def __init__(self, hand, profile):
        self.hand = hand
        self.profile = profile
        self.conditioner = Conditioner()

    def image(self, counts, missing=None):
        missing = np.zeros(len(self.hand), dtype=bool) if missing is None else missing
        force, self.contact, faulty = self.conditioner.feed(counts, missing)
        return compress(force, self.contact, faulty, missing, self.hand.xy, self.hand.shape, self.profile)


def assert_same(image, expected, where):
    """Every byte of the image, every level and every actuator. Forces travel as single precision."""
    pixels = np.frombuffer(image.pixels, np.uint8).reshape(image.height, image.width)
    assert (image.contacts, image.missing) == (expected.contacts, expected.missing), where
    # Which taxels are faulty is told when the calibration is done.
    assert image.calibrating or image.faulty == expected.faulty, where
    assert not (image.calibrating and expected.contacts), where
    assert list(image.levels) == [float(np.float32(f)) for f in expected.levels], where
    got = [(a.id, a.x, a.y, a.level, a.force) for a in image.actuators]
    want = [(*a[:4], float(np.float32(a[4]))) for a in expected.actuators]
    assert got == want, f"{where}: actuators are {sorted({*got} - {*want})}, not {sorted({*want} - {*got})}"
    assert np.array_equal(pixels, expected.pixels), f"{where}: pixels differ at {np.argwhere(pixels != expected.pixels)}"


def pairs(reader, count):
    """`count` times the image and the raw counts of one tick."""
    images, raws, done = {}, {}, 0
    while done < count:
        message = reader.receive(20)
        assert message is not None, "the daemon sends nothing more"
        if isinstance(message, taxel_reader.Image):
            images[message.seq] = message
        elif isinstance(message, taxel_reader.Raw):
            raws[message.header.seq] = message
        for seq in images.keys() & raws.keys():
            yield images.pop(seq), raws.pop(seq)
            done += 1


def content(image):
    """What must be the same when the same recording is played again: everything but the header."""
    return image._replace(header=None)
