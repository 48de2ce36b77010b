"""Files of images."""

import json

import numpy as np
import pytest
import taxel
from taxel.fake import encode_image

LINE = {
    "seq": 7,
    "t_ns": 9,
    "latency_us": None,
    "width": 3,
    "height": 2,
    "image": [0, 0, 0, 0, 128, 255],
    "levels": [10.0, 20.0],
    "actuators": [{"id": 1, "x": 2, "y": 1, "level": 2, "force": 20.0}],
    "contacts": 2,
    "faulty": 1,
    "missing": 0,
    "joints": [0.25, None],
}
EMPTY = {**LINE, "seq": 8, "image": [0] * 6, "levels": [], "actuators": [], "contacts": 0}


def check(images):
    assert len(images) == 2 and images.pixels.shape == (2, 2, 3)
    first, second = images
    assert first.pixels.tolist() == [[0, 0, 0], [0, 128, 255]]
    assert (first.seq, first.t_ns, first.contacts, first.faulty, first.missing) == (7, 9, 2, 1, 0)
    assert first.actuators.tolist() == [(1, 2, 1, 2, 20.0)]
    assert first.levels.tolist() == [10.0, 20.0]
    assert first.joints[0] == 0.25 and np.isnan(first.joints[1])
    assert len(second.levels) == len(second.actuators) == 0


def test_lines_of_watch_and_messages_of_compress_are_the_same_images(tmp_path):
    lines = tmp_path / "a.jsonl"
    lines.write_text(f"{json.dumps(LINE)}\n\n{json.dumps(EMPTY)}\n")
    check(taxel.load(lines))
    messages = tmp_path / "a.bin"
    messages.write_bytes(b"".join(encode_image(image) for image in taxel.load(lines)))
    check(taxel.load(messages))


def test_arrays_of_compress_are_the_same_images(tmp_path):
    nothing = [[np.nan] * 5] * 2
    arrays = {
        "images": np.array([LINE["image"], EMPTY["image"]], np.uint8).reshape(2, 2, 3),
        "levels": np.array([[10.0, 20.0], [np.nan, np.nan]]),
        "actuators": np.array([[[1, 2, 1, 2, 20.0], nothing[0]], nothing]),
        "seq": np.array([7, 8], np.uint64),
        "t_ns": np.array([9, 9], np.uint64),
        "contacts": np.array([2, 0], np.uint16),
        "faulty": np.array([1, 1], np.uint16),
        "missing": np.array([0, 0], np.uint16),
        "joints": np.array([[0.25, np.nan]] * 2, np.float32),
    }
    np.savez(tmp_path / "a.npz", **arrays)
    check(taxel.load(tmp_path / "a.npz"))
    del arrays["seq"]
    np.savez(tmp_path / "b.npz", **arrays)
    with pytest.raises(ValueError, match="b.npz has no array 'seq'"):
        taxel.load(tmp_path / "b.npz")


def test_a_damaged_file_is_refused_with_the_place(tmp_path):
    lines = tmp_path / "a.jsonl"
    lines.write_text(f"{json.dumps(LINE)}\n{{\n")
    with pytest.raises(ValueError, match="a.jsonl:2: no image"):
        taxel.load(lines)
    cut = tmp_path / "a.bin"
    lines.write_text(json.dumps(LINE))
    whole = encode_image(taxel.load(lines)[0])
    cut.write_bytes(whole + whole[:50])
    with pytest.raises(ValueError, match=f"byte {len(whole)}: truncated"):
        taxel.load(cut)
    with pytest.raises(ValueError, match=".npz, .jsonl and .bin"):
        taxel.load("a.png")


def test_a_file_without_images_has_none(tmp_path):
    (tmp_path / "a.jsonl").write_text("")
    assert len(taxel.load(tmp_path / "a.jsonl")) == 0
