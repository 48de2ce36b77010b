"""The package `taxel`: built, installed into a fresh environment, and used on the real daemon."""

import json
import subprocess
import sys
import sysconfig

import pytest
from harness.daemon import REPOSITORY, binary

PACKAGE = REPOSITORY / "python"

FOLLOW = """
import json, sys
import taxel

images, control = sys.argv[1:]
with taxel.connect(images, profile={"levels": 4, "actuators": 5}) as hand:
    for image in hand:
        print(json.dumps([image.seq, list(image.pixels.shape), hand.hello["profile"]["levels"], hand.restarts]), flush=True)
        if sys.stdin.readline().strip() == "end":
            break
asked = taxel.Control(control)
print(json.dumps([asked.profile()["levels"], asked.status()["layout"], asked.mark("over").seq >= 0]), flush=True)
try:
    asked.mark("")
except taxel.Refused as error:
    print(json.dumps(str(error)), flush=True)
"""


@pytest.fixture(scope="module")
def python(tmp_path_factory):
    """A fresh environment with nothing but the wheel; numpy is that of the tests."""
    folder = tmp_path_factory.mktemp("package")
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check"]
    build = [*pip, "wheel", "-q", "--no-deps", "--no-build-isolation", "-w", folder, PACKAGE]
    subprocess.run(build, check=True)
    (wheel,) = folder.glob("taxel-*.whl")
    environment = folder / "environment"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", environment], check=True)
    python = environment / "bin/python"
    subprocess.run([*pip, "--python", python, "install", "-q", "--no-deps", "--no-index", wheel], check=True)
    (packages,) = environment.glob("lib/python*/site-packages")
    (packages / "numpy-of-the-tests.pth").write_text(sysconfig.get_path("purelib"))
    return python


def test_it_follows_the_daemon_through_a_restart_and_asks_it(python, start, folder):
    daemon = start(tick={"mode": "timer", "rate_hz": 30.0})
    script = folder / "follow.py"
    script.write_text(FOLLOW)
    command = [python, "-I", script, daemon.images, daemon.control_path]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as follower:
        first = json.loads(follower.stdout.readline())
        assert first[1:] == [[16, 16], 4, 0]
        daemon.stop()
        daemon.start()
        follower.stdin.write("more\n")
        follower.stdin.flush()
        restarted = json.loads(follower.stdout.readline())
        while restarted[3] == 0:
            # Images of before that had arrived.
            follower.stdin.write("more\n")
            follower.stdin.flush()
            restarted = json.loads(follower.stdout.readline())
        assert restarted[1:] == [[16, 16], 4, 1]
        follower.stdin.write("end\n")
        follower.stdin.close()
        assert json.loads(follower.stdout.readline()) == [8, "allegro-uskin-15", True]
        assert "text" in json.loads(follower.stdout.readline())
        assert follower.wait() == 0


def test_it_reads_what_compress_writes(python, folder):
    for name in ("a.npz", "a.jsonl", "a.bin"):
        subprocess.run([binary("taxel"), "compress", "sim:tap", "--out", folder / name], check=True)
    same = """
import sys, numpy, taxel
npz, jsonl, binary = (taxel.load(path) for path in sys.argv[1:])
assert len(npz) == len(jsonl) == len(binary) > 100
for a, b, c in zip(npz, jsonl, binary):
    for other in (b, c):
        assert (a.seq, a.t_ns, a.contacts, a.faulty, a.missing) == (other.seq, other.t_ns, other.contacts, other.faulty, other.missing)
        assert numpy.array_equal(a.pixels, other.pixels)
        assert numpy.allclose(a.levels, other.levels, rtol=1e-6)
        assert a.actuators[["id", "x", "y", "level"]].tolist() == other.actuators[["id", "x", "y", "level"]].tolist()
"""
    files = [folder / name for name in ("a.npz", "a.jsonl", "a.bin")]
    subprocess.run([python, "-I", "-c", same, *files], check=True)


def test_it_tells_which_taxels_of_a_faulty_hand_had_no_value(python, folder):
    files = [folder / name for name in ("a.npz", "a.csv")]
    for file in files:
        subprocess.run([binary("taxel"), "convert", "sim:faulty-hand", file], check=True)
    same = """
import sys, numpy, taxel
npz, csv = (taxel.load_frames(path) for path in sys.argv[1:])
assert len(npz) > 100 and npz.without_value.shape == npz.counts.shape[:2]
assert npz.without_value.any() and not npz.without_value.all(axis=0).any()
assert not npz.counts[npz.without_value].any()
for name in ("counts", "t_ns", "joints", "without_value"):
    assert numpy.array_equal(getattr(npz, name), getattr(csv, name), equal_nan=name == "joints"), name
"""
    subprocess.run([python, "-I", "-c", same, *files], check=True)


def test_what_its_fake_daemon_refuses_the_daemon_refuses(python, start):
    daemon = start()
    refused = """
import runpy, sys, taxel
images, control, tests = sys.argv[1:]
cases = runpy.run_path(tests)
taken = []
for asked in cases["REFUSED"]:
    with taxel.connect(images, **asked) as hand:
        try:
            taken.append((asked, hand.next()))
        except taxel.Refused:
            pass
for request in cases["REFUSED_REQUESTS"]:
    with taxel.Control(control) as asked:
        try:
            taken.append((request, asked.request(request)))
        except taxel.Refused:
            pass
sys.exit(str(taken) if taken else 0)
"""
    command = [python, "-I", "-c", refused, daemon.images, daemon.control_path, PACKAGE / "tests/test_fake.py"]
    ended = subprocess.run(command, capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr


def test_its_own_tests_and_types_hold():
    tests = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", PACKAGE / "tests"]
    environment = {"PYTHONPATH": str(PACKAGE / "src"), "PYTHONDONTWRITEBYTECODE": "1", "PATH": "/usr/bin:/bin"}
    ended = subprocess.run(tests, cwd=PACKAGE, env=environment, capture_output=True, text=True)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    types = [sys.executable, "-m", "mypy", "--cache-dir=/dev/null"]
    ended = subprocess.run(types, cwd=PACKAGE, capture_output=True, text=True)
    assert ended.returncode == 0, ended.stdout + ended.stderr
