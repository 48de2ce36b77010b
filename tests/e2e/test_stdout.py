"""A standard output that is closed or full: every command that prints ends with an error, and says so."""

import os
import re
import subprocess

import pytest
from harness.daemon import Daemon, binary
from harness.recorder import longer_each_time


CLOSED = ("&-", "stdout is closed")
FULL = ("/dev/full", "No space left on device")

# What is typed, by command. Files are new ones at each run, NEW in their names; SECONDS are enough for something to come.
PRINTING = {
    "": ["taxel --help", "taxel --version", "taxel --list", "taxel help", "taxel help config show"],
    "taxeld": ["taxeld --help", "taxeld --version", "taxeld --config d/taxeld.toml --check"],
    "demo": [f"taxel demo --seconds SECONDS {option}" for option in ("", "--headless", "--json")],
    "view": [f"taxel view {what} --seconds SECONDS" for what in ("", "--json", "tap.log", "tap.log --json")],
    "watch": ["taxel watch --count 2", "taxel watch --count 2 --json", "taxel watch --count 2 --hz"],
    "layouts": [
        "taxel layouts",
        "taxel layouts --json",
        "taxel layouts allegro-uskin-15",
        "taxel layouts allegro-uskin-15 --json",
        "taxel layouts uskin-module --file",
    ],
    "record": ["taxel record NEW.mcap --seconds SECONDS --json"],
    "replay": ["taxel replay tap.log --to - --speed 1000"],
    "convert": ["taxel convert tap.log -", "taxel convert tap.log NEW.npz --json"],
    "compress": ["taxel compress tap.log --out -", "taxel compress tap.log --out NEW.npz --json"],
    "eval": [f"taxel eval tap.log --passes 1 --restarts 1 {json}" for json in ("", "--json")],
    "categorize": [f"taxel categorize sim:phantom-1 --classes 5 {json}" for json in ("", "--json")],
    "forearm train": ["taxel forearm train session.npz --out NEW"],
    "forearm estimate": [f"taxel forearm estimate estimator session.npz {json}" for json in ("", "--json")],
    "forearm eval": [f"taxel forearm eval session.npz --brief --repetitions 1 {json}" for json in ("", "--json")],
    "forearm simulate": ["taxel forearm simulate --out NEW.npz --repetitions 1"],
    "forearm figures": ["taxel forearm figures session.npz --repetitions 1 --out NEW"],
    "forearm fingers": ["taxel forearm fingers session.npz"],
    "sim": ["taxel sim --list", "taxel sim --list --json", "taxel sim tap --show"],
    "doctor": [f"taxel doctor {what}" for what in ("", "--json", "--scan log:tap.log", "--scan log:tap.log --json")],
    "status": ["taxel status", "taxel status --json"],
    "rezero": ["taxel rezero", "taxel rezero --json"],
    "pause": ["taxel pause --json"],
    "resume": ["taxel resume --json"],
    "profile": ["taxel profile", "taxel profile '{}' --json"],
    "mark": ["taxel mark here", "taxel mark here --json"],
    "metrics": ["taxel metrics", "taxel metrics --json"],
    "completions": [f"taxel completions {shell}" for shell in ("bash", "elvish", "fish", "powershell", "zsh")],
    "config init": ["taxel config init"],
    "config check": ["taxel config check d/taxeld.toml", "taxel config check d/taxeld.toml --json"],
    "config show": ["taxel config show d/taxeld.toml", "taxel config show d/taxeld.toml --json"],
}

# And what prints nothing, or not here.
OTHERS = {
    "figures": "writes files, and says so on stderr",
    "servo": "prints nothing",
    "foxglove": "goes on until it is ended",
    "setup": "asks, and a hand has to be there",
    "forearm record": "asks, and a gripper has to be there",
}


def commands(*path):
    """The commands that `--help` knows, those of commands too."""
    text = subprocess.run([binary("taxel"), *path, "--help"], capture_output=True, text=True, check=True).stdout
    block = re.search(r"^Commands:\n(.*?)^\S", text, re.M | re.S)
    below = re.findall(r"^  ([a-z]\S*)", block[1], re.M) if block else []
    below = [name for name in below if name != "help"]
    return [command for name in below for command in commands(*path, name)] or [" ".join(path)]


def shell(line, folder, **options):
    path = os.pathsep.join([str(binary("taxel").parent), os.environ["PATH"]])
    environment = {**os.environ, "PATH": path, "RUNTIME_DIRECTORY": str(folder / "d"), "NO_COLOR": "1"}
    options = {"stdin": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True, **options}
    return subprocess.run(["bash", "-c", line], cwd=folder, env=environment, **options)


def made(folder, line):
    ended = shell(line, folder, stdout=subprocess.DEVNULL)
    assert ended.returncode == 0, ended.stderr
    return folder


@pytest.fixture(scope="module")
def tap(tmp_path_factory):
    return made(tmp_path_factory.mktemp("tap"), "taxel sim tap --to log:tap.log")


@pytest.fixture(scope="module")
def squeezes(tmp_path_factory):
    simulate = "taxel forearm simulate --out session.npz --repetitions 2"
    train = "taxel forearm train session.npz --out estimator"
    return made(tmp_path_factory.mktemp("squeezes"), f"{simulate} && {train}")


# What is read, and the fixture that makes it.
READ = {"tap.log": "tap", "session.npz": "squeezes", "estimator": "squeezes"}


@pytest.fixture
def run(folder, request):
    """Runs a line in a folder with what it reads, beside a daemon where it looks for one."""

    def run(line, **options):
        for file, maker in READ.items():
            if file in line and not (folder / file).exists():
                (folder / file).symlink_to(request.getfixturevalue(maker) / file)
        return shell(line, folder, **options)

    with Daemon(folder / "d", ["sim:ball-grasp"] * 2, tick={"mode": "timer", "rate_hz": 30.0}):
        yield run


def run_long_enough(run, line, **options):
    for seconds in longer_each_time():
        ended = run(line.replace("SECONDS", str(seconds)), **options)
        if "SECONDS" not in line or not re.search("nothing came of a daemon|no image came", ended.stderr):
            return ended


def test_every_command_is_here(folder):
    assert sorted([*PRINTING, *OTHERS]) == sorted(["", "taxeld", *commands()])


@pytest.mark.parametrize("command", [*PRINTING, *OTHERS])
def test_what_cannot_be_printed_is_an_error_and_what_nobody_reads_is_none(command, run):
    lines = [*PRINTING.get(command, []), *([f"taxel {command} --help"] if command not in ("", "taxeld") else [])]
    wrong = []
    for number, line in enumerate(lines):
        for kind, (to, word) in enumerate((CLOSED, FULL)):
            ended = run_long_enough(run, line.replace("NEW", f"new-{number}-{kind}") + f" >{to}")
            if ended.returncode != 1 or word not in ended.stderr:
                wrong.append(f"{line} >{to}: exit code {ended.returncode}, {ended.stderr[-300:]!r}")
        # A pipe that nobody reads any more. The doctor finds fault with the machine in any case.
        reader, writer = os.pipe()
        os.close(reader)
        ended = run_long_enough(run, line.replace("NEW", f"new-{number}-pipe"), stdout=writer)
        os.close(writer)
        if ended.returncode != 0 and not line.startswith("taxel doctor"):
            wrong.append(f"{line} | true: exit code {ended.returncode}, {ended.stderr[-300:]!r}")
    assert not wrong, "\n".join(wrong)


def test_what_prints_nothing_needs_no_stdout(run):
    for line in ("taxel pause", "taxel resume", "taxel compress tap.log --out images.npz"):
        ended = run(f"{line} >&-")
        assert ended.returncode == 0, ended.stderr
