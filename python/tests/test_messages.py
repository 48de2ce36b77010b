"""Messages as arrays, and the fake daemon's own, against the vectors of all readers."""

import json
from pathlib import Path

import numpy as np
import pytest
from taxel import _reader
from taxel.fake import encode_image
from taxel.messages import Image, Raw, of_reader

VECTORS = Path(__file__).parents[2] / "crates/wire/vectors"
EXPECTED = {path: json.loads(path.with_suffix(".json").read_text())["expected"] for path in VECTORS.glob("*.bin")}
GOOD = sorted(path for path, expected in EXPECTED.items() if "error" not in expected)


def decoded(path):
    try:
        return of_reader(_reader.decode_packet(path.read_bytes()))
    except ValueError:
        return None


@pytest.mark.skipif(not GOOD, reason="no vectors beside the package")
def test_the_vectors_of_images_say_the_same_as_arrays():
    images = {path.stem: image for path in GOOD if isinstance(image := decoded(path), Image)}
    assert len(images) >= 3
    for name, image in images.items():
        expected = json.loads((VECTORS / f"{name}.json").read_text())["expected"]
        assert image.pixels.tobytes().hex() == expected["pixels"], name
        assert [list(a) for a in image.actuators.tolist()] == expected["actuators"], name
        assert image.levels.tolist() == expected["levels"], name


@pytest.mark.skipif(not GOOD, reason="no vectors beside the package")
def test_the_fake_daemon_makes_the_bytes_of_the_page():
    path = VECTORS / "image_minor_1.bin"
    assert encode_image(decoded(path)) == path.read_bytes()


@pytest.mark.skipif(not GOOD, reason="no vectors beside the package")
def test_raw_frames_are_columns_of_taxels():
    found = 0
    for path in GOOD:
        raw = decoded(path)
        if not isinstance(raw, Raw):
            continue
        found += 1
        taxels = _reader.decode_packet(path.read_bytes()).taxels
        assert raw.counts.shape == raw.press.shape == (len(taxels), 3)
        assert [tuple(c) for c in raw.counts.tolist()] == [t.counts for t in taxels]
        assert raw.contact.tolist() == [t.contact for t in taxels]
        if raw.baselines is not None:
            presses = [t.press(tuple(map(float, b))) for t, b in zip(taxels, raw.baselines)]
            assert np.array_equal(raw.press, np.array(presses, np.float32), equal_nan=True)
    assert found


def test_version_and_licences_are_those_of_the_workspace():
    import taxel

    root = Path(__file__).parents[2]
    if not (root / "Cargo.toml").exists():
        pytest.skip("not in the repository")
    assert f'version = "{taxel.__version__}"' in (root / "Cargo.toml").read_text()
    assert f'version = "{taxel.__version__}"' in (root / "python/pyproject.toml").read_text()
    for name in ("LICENSE-APACHE", "LICENSE-MIT"):
        assert (root / "python" / name).read_bytes() == (root / name).read_bytes()
