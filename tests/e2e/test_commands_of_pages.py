"""Every command of README.md and docs/ is run, or stands in commands_of_pages.toml with the reason why not."""

import os
import shutil
import signal
import subprocess
import tomllib
from pathlib import Path

import numpy as np
import pytest
from harness.bus import GROUP, free_udp_ports
from harness.daemon import REPOSITORY, binary, die_with_parent, eventually
from harness.pages import PAGES, commands

LISTED = tomllib.loads((Path(__file__).parent / "commands_of_pages.toml").read_text())
NOT_RUN = {line for why in LISTED["not_run"] for line in why.get("lines", [])}
PAGES_NOT_RUN = {page for why in LISTED["not_run"] for page in why.get("pages", [])}


def to_run(page):
    return [c for c in commands(page) if c not in NOT_RUN] if page.name not in PAGES_NOT_RUN else []


@pytest.fixture
def bench(folder):
    """A folder with what commands read, our programs in PATH, and a daemon where they look for one."""
    path = os.pathsep.join([str(binary("taxel").parent), str(Path(os.sys.executable).parent), os.environ["PATH"]])
    environment = {**os.environ, "PATH": path, "RUNTIME_DIRECTORY": str(folder / "run"), "NO_COLOR": "1"}

    def run(command, **options):
        return subprocess.run(
            ["bash", "-c", command], cwd=folder, env=environment, capture_output=True, text=True, **options
        )

    made = run(
        "taxel sim ball-grasp --to log:grasp.log && cp grasp.log candump-2026-11-20.log && mkdir -p docs/figures grasps"
        " && taxel config init --source sim:ball-grasp --source sim:ball-grasp --out hand.toml"
    )
    assert made.returncode == 0, made.stderr
    random = np.random.default_rng(1)
    np.save(folder / "grasp.npy", random.uniform(0, 40, (30, 16, 16)))
    rows = np.hstack([random.integers(20_000, 30_000, (60, 720)), random.uniform(0, 1, (60, 16))])
    np.savetxt(folder / "grasp.csv", rows, delimiter=",", fmt="%.3f")
    daemon = subprocess.Popen(
        [binary("taxeld"), "--config", "hand.toml"],
        cwd=folder,
        env=environment,
        stderr=subprocess.DEVNULL,
        preexec_fn=die_with_parent,
    )
    try:
        eventually(lambda: run("taxel status").returncode == 0, "the daemon does not answer")
        yield folder, run, environment
    finally:
        daemon.kill()
        daemon.wait()


def interrupted(command, shows, folder, environment):
    """Runs a command until it shows that it works, then ends it as Ctrl-C does."""
    out = folder / "said"
    with out.open("wb") as stdout, (folder / "complained").open("wb") as stderr:
        process = subprocess.Popen(
            ["bash", "-c", f"exec {command}"], cwd=folder, env=environment, stdout=stdout, stderr=stderr, preexec_fn=die_with_parent
        )
    try:
        target = out if shows == "stdout" else folder / shows
        complaint = folder / "complained"
        enough = LISTED["enough_bytes"] if target.suffix == ".mcap" else 1
        eventually(lambda: target.exists() and target.stat().st_size >= enough, lambda: f"{command}: {complaint.read_text()}")
        process.send_signal(signal.SIGINT)
        assert process.wait() in (0, 130, -signal.SIGINT), f"{command}: {complaint.read_text()}"
    finally:
        process.kill()
        process.wait()


@pytest.mark.parametrize("page", [page for page in PAGES if to_run(page)], ids=lambda page: page.name)
def test_commands_of_a_page_do_what_it_says(bench, page):
    folder, run, environment = bench
    buses = {f"can:vcan{n}": f"udp:{GROUP}:{port}?hops=0" for n, port in enumerate(free_udp_ports(2))}
    instead_of = buses | LISTED["instead"]
    for command in to_run(page):
        typed = command
        for what, instead in instead_of.items():
            typed = typed.replace(what, instead)
        if command in LISTED["endless"]:
            interrupted(typed, LISTED["endless"][command], folder, environment)
            continue
        if "grasps/" in command:
            shutil.copy(folder / "grasp.csv", folder / "grasps/ball.csv")
        if "grasp.mcap" in command and not (folder / "grasp.mcap").exists():  # on a page that records none
            assert run("taxel convert grasp.log grasp.mcap").returncode == 0
        ended = run(typed)
        good = (0, 1) if command in LISTED["find_fault"]["lines"] else (0,)
        assert ended.returncode in good, f"{page.name}: {typed}\n{ended.stdout[-3000:]}{ended.stderr[-3000:]}"


def test_the_list_of_commands_that_are_not_run_is_short_of_nothing_and_has_nothing_to_spare():
    present = {command for page in PAGES for command in commands(page)}
    listed = NOT_RUN | LISTED["endless"].keys() | set(LISTED["find_fault"]["lines"])
    assert listed <= present, "commands that no page has any more"
    assert PAGES_NOT_RUN <= {page.name for page in PAGES}
    for why in LISTED["not_run"]:
        for place in why.get("tested", []):
            assert (REPOSITORY / place).exists(), f"{place}, where {why['lines'][0]} is said to be tested"
