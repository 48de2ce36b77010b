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


def arrays():
    nothing = [[np.nan] * 5] * 2
    return {
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


def test_arrays_of_compress_are_the_same_images(tmp_path):
    np.savez(tmp_path / "a.npz", **arrays())
    check(taxel.load(tmp_path / "a.npz"))


@pytest.mark.parametrize(
    ("damage", "why"),
    [
        ({"seq": None}, "seq is not a file in the archive"),
        ({"levels": np.zeros((3, 2))}, "3 levels and 2 seq"),
        ({"images": np.zeros((2, 6), np.uint8)}, r"pixels of shape \(2, 6\)"),
    ],
)
def test_arrays_that_do_not_fit_together_are_refused(tmp_path, damage, why):
    given = {**arrays(), **damage}
    np.savez(tmp_path / "a.npz", **{key: value for key, value in given.items() if value is not None})
    with pytest.raises(ValueError, match=f"a.npz: .*{why}"):
        taxel.load(tmp_path / "a.npz")


@pytest.mark.parametrize("load", [taxel.load, taxel.load_frames])
def test_what_is_no_archive_is_not_advised_to_be_trusted(tmp_path, load):
    path = tmp_path / "a.npz"
    path.write_text("contacts\n1\n")
    with pytest.raises(ValueError, match="a.npz: no .*it is no archive of arrays") as refused:
        load(path)
    assert "pickle" not in str(refused.value)


def test_a_cut_file_of_arrays_is_refused_wherever_it_ends(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, **arrays())
    whole = path.read_bytes()
    for end in range(0, len(whole), 97):
        path.write_bytes(whole[:end])
        with pytest.raises(ValueError, match="a.npz: no .npz as"):
            taxel.load(path)


def test_images_of_different_sizes_are_refused_with_the_place(tmp_path):
    larger = {**EMPTY, "width": 6, "height": 1}
    lines, messages = tmp_path / "a.jsonl", tmp_path / "a.bin"
    jointless = {**LINE, "joints": []}
    for other, what in ((larger, "1 rows, 6 columns and 2 joints"), (jointless, "2 rows, 3 columns and 0 joints")):
        packets = []
        for line in (LINE, other):
            lines.write_text(json.dumps(line))
            packets.append(encode_image(taxel.load(lines)[0]))
        lines.write_text(f"{json.dumps(LINE)}\n{json.dumps(other)}\n")
        messages.write_bytes(b"".join(packets))
        for path, place in ((lines, "jsonl:2"), (messages, f"bin: byte {len(packets[0])}")):
            with pytest.raises(ValueError, match=f"a.{place}: an image of {what} behind those of 2 rows"):
                taxel.load(path)


def test_a_slice_is_images_too(tmp_path):
    lines = tmp_path / "a.jsonl"
    lines.write_text("\n".join(json.dumps({**LINE, "seq": seq}) for seq in range(5)))
    images = taxel.load(lines)
    assert [image.seq for image in images[1:3]] == [1, 2] == images[1:3].seq.tolist()
    assert images[::-2][0].seq == images[-1].seq == 4 and len(images[5:]) == 0


def test_a_damaged_file_is_refused_with_the_place(tmp_path):
    lines = tmp_path / "a.jsonl"
    lines.write_text(f"{json.dumps(LINE)}\n{{\n")
    with pytest.raises(ValueError, match="a.jsonl:2: no image"):
        taxel.load(lines)
    for key, value in (("image", [0, 0, 0, 0, 0, 256]), ("seq", -1), ("contacts", 2**32)):
        lines.write_text(json.dumps({**LINE, key: value}))
        with pytest.raises(ValueError, match="a.jsonl:1: no image"):
            taxel.load(lines)
    lines.write_bytes(b"\xff")
    with pytest.raises(ValueError, match="a.jsonl:1: no image"):
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


def test_a_last_line_that_is_torn_is_left_out_and_said(tmp_path):
    path = tmp_path / "day.jsonl"
    whole = "".join(f"{json.dumps(line)}\n" for line in (LINE, EMPTY))
    # As where the power went, in the middle of a line or of a character.
    for torn in (json.dumps(LINE)[:40].encode(), b"{", b'{"caf\xc3'):
        path.write_bytes(whole.encode() + torn)
        with pytest.warns(UserWarning, match="day.jsonl:3: torn, and left out"):
            check(taxel.load(path))
    # A whole one without the end of its line is no torn one, and one with it is damaged.
    path.write_text(whole.rstrip("\n"))
    check(taxel.load(path))
    path.write_text(f"{whole}{{\n")
    with pytest.raises(ValueError, match="day.jsonl:3: no image"):
        taxel.load(path)
