"""taxel doctor on real SocketCAN: an interface that is up, and one that is down."""

import json
import os
import subprocess

import pytest
from harness.daemon import binary


@pytest.fixture
def link():
    subprocess.run(["ip", "link", "add", "sick0", "type", "vcan"], check=True)
    yield "sick0"
    subprocess.run(["ip", "link", "del", "sick0"], check=True)


def doctor(source, folder):
    run = subprocess.run(
        [binary("taxel"), "doctor", "--json", "--layout", "uskin-module", "--seconds", "0.3", source],
        capture_output=True,
        text=True,
        # No daemon of this machine.
        env={**os.environ, "XDG_RUNTIME_DIR": str(folder)},
    )
    checks = json.loads(run.stdout)["checks"]
    return run.returncode, {c["name"]: c for c in checks if c["area"] in ("machine", "link")}


def test_an_interface_that_is_up_is_well_and_one_that_is_down_is_named_with_its_command(link, tmp_path):
    code, checks = doctor(f"can:{link}", tmp_path)
    assert code == 1
    assert checks["AF_CAN"]["state"] == "ok"
    assert checks["link"]["state"] == "error" and checks["link"]["found"] == "is down"
    assert checks["link"]["mend"] == f"sudo ip link set {link} up"
    subprocess.run(["ip", "link", "set", link, "up"], check=True)
    _, checks = doctor(f"can:{link}", tmp_path)
    assert checks["link"]["state"] == "ok" and checks["link"]["found"] == "up, vcan"
    assert "bit rate" not in checks, "a virtual interface has none"
    _, checks = doctor("can:sick1", tmp_path)
    assert checks["interface"]["state"] == "error" and link in checks["interface"]["mend"]
