"""Actuators on grids of up to ten thousands of taxels are where the recipe puts them, offline as live."""

import subprocess

import numpy as np
import pytest
import taxel_reader
from following_actuators import Follower, heights, next_of
from harness.daemon import binary


def images(folder, frames, actuators):
    """What `taxel compress` makes of magnitudes, T x H x W; above a half is contact."""
    recording, out = folder / "skin.npy", folder / "images.bin"
    np.save(recording, frames)
    layout = f"grid:{frames.shape[1]}x{frames.shape[2]}"
    more = ["--layout", layout, "--threshold", "0.5", "--actuators", str(actuators), "--out", out]
    subprocess.run([binary("taxel"), "compress", recording, *more], check=True, capture_output=True)
    data, made = out.read_bytes(), []
    while data:
        image, length = taxel_reader.decode(data)
        data = data[length:]
        made.append(image)
    return made


def press(height, width, centre, radius, random, flicker):
    """A round press whose contacts miss here and there."""
    y, x = np.mgrid[:height, :width]
    off = ((x - centre[0]) / radius[0]) ** 2 + ((y - centre[1]) / radius[1]) ** 2
    force = np.where(off < 1, 1 + 9 * (1 - off), 0)
    return np.where(random.random(force.shape) < flicker, 0, force)


def slides(height, width, frames, size, flicker):
    """A press of a share of the skin that slides and breathes, each frame twice, and holds still in the end."""
    random = np.random.default_rng(11)
    made = []
    for t in range(frames):
        centre = (width * (0.5 + 0.02 * t), height * (0.5 - 0.01 * t))
        radius = [side * size * (1 + 0.03 * (t % 3)) for side in (width, height)]
        made += [press(height, width, centre, radius, random, flicker)] * 2
    return np.array(made + made[-1:] * 8)


def fills(height, width, frames):
    """Contacts here and there, then a part of the skin, then all of it."""
    random = np.random.default_rng(12)
    made = np.ones((2 + frames, height, width))
    made[0] = random.random((height, width)) < 0.1
    made[1, :, width * 2 // 3 :] = 0
    return made


def walks(rows, columns, every):
    """A block of contacts that goes on by a pixel, to the right and down in turns, on a skin of 28 x 28."""
    force = np.random.default_rng(13).integers(10, 100, (rows, columns)).astype(float)
    made = np.zeros((20 * every, 28, 28))
    for t, frame in enumerate(made):
        left, top = (t // every + 1) // 2, t // every // 2
        frame[top : top + rows, left : left + columns] = force
    return made


def where_the_recipe_puts_them(folder, frames, actuators):
    """Checks the actuators of every frame; returns the images."""
    follower = Follower(actuators)
    neighbours = next_of([(x, y) for y in range(frames.shape[1]) for x in range(frames.shape[2])])
    made = images(folder, frames, actuators)
    assert len(made) == len(frames)
    for i, (image, force) in enumerate(zip(made, frames)):
        y, x = np.nonzero(force > 0.5)
        xy = np.column_stack([x, y])
        _, member = follower.follow(xy, height=heights(force[y, x], xy, neighbours))
        assert image.contacts == len(xy)
        assert [(a.id, a.x, a.y) for a in image.actuators] == [(k, *xy[n]) for k, n in sorted(member.items())], f"frame {i}"
    return made


@pytest.mark.parametrize(
    "frames, actuators, contacts",
    [
        (slides(40, 40, 5, 0.45, 0.05), 16, 800),
        (slides(64, 64, 5, 0.45, 0.05), 16, 2048),
        (slides(128, 96, 3, 0.5, 0.02), 7, 8192),
        (fills(255, 255, 3), 5, 65025),
        (slides(40, 40, 2, 0.5, 0.05), 1024, 1100),
    ],
    ids=["about 1,024 contacts", "thousands", "ten thousand", "65,025 contacts", "1,024 actuators, ties everywhere"],
)
def test_actuators_of_a_large_skin_are_where_the_recipe_puts_them(folder, frames, actuators, contacts):
    made = where_the_recipe_puts_them(folder, frames, actuators)
    assert max(image.contacts for image in made) >= contacts


@pytest.mark.parametrize("rows, columns", [(4, 4), (4, 5), (3, 6), (1, 17)], ids=lambda n: str(n))
@pytest.mark.parametrize("every", [1, 3])
def test_a_block_that_goes_on_by_a_pixel_takes_its_actuators_along(folder, rows, columns, every):
    made = where_the_recipe_puts_them(folder, walks(rows, columns, every), 16)
    ways = []
    for before, after in zip(made, made[1:]):
        at = {a.id: (a.x, a.y) for a in before.actuators}
        ways += [np.hypot(a.x - at[a.id][0], a.y - at[a.id][1]) for a in after.actuators if a.id in at]
    assert len(ways) > 250
    assert max(ways) <= 2
