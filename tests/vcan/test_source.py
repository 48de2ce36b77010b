"""The crate's own tests of its source, which tests/run has built and which cargo cannot run where there is no SocketCAN."""

import os
import subprocess

import pytest

LONGEST_TEST_S = 400  # in an emulated machine


@pytest.mark.skipif("TAXEL_VCAN_TESTS" not in os.environ, reason="TAXEL_VCAN_TESTS names no executable")
def test_the_source_on_real_interfaces():
    ended = subprocess.run(
        [os.environ["TAXEL_VCAN_TESTS"], "--test-threads=1", "--show-output"],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    print(ended.stdout)
    assert ended.returncode == 0 and "SKIPPED" not in ended.stdout
