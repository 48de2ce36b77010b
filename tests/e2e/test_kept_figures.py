"""The pictures of the documentation are what the commands beside them draw today."""

import subprocess
from pathlib import Path

import pytest
from harness.daemon import binary

ROOT = Path(__file__).parents[2]
KEPT = ROOT / "docs/figures"


@pytest.mark.parametrize(
    ("command", "drawn"),
    [
        (
            "figures sim:ball-grasp --out .",
            ["ball-grasp-frame.svg", "ball-grasp-instants.svg", "ball-grasp-time.svg"],
        ),
        ("figures sim:objects --out .", ["recordings.svg", "recordings-table.csv"]),
        ("view sim:ball-grasp --seconds 8 --svg view.svg", ["view.svg"]),
        (
            f"categorize --sweep {ROOT / 'examples/palpation/phantoms.csv'} --figures .",
            ["figure-08.svg", "figure-13.svg", "figure-14.svg", "figure-16.svg"],
        ),
    ],
)
def test_a_kept_picture_is_what_its_command_draws(tmp_path, command, drawn):
    made = subprocess.run(
        [binary("taxel"), *command.split()], cwd=tmp_path, capture_output=True, text=True
    )
    assert made.returncode == 0, made.stderr
    other = [
        name
        for name in drawn
        if (tmp_path / name).read_bytes() != (KEPT / name.replace("figure-", "palpation-")).read_bytes()
    ]
    assert not other, f"not as in docs/figures: {other}; taxel {command} draws them anew"
