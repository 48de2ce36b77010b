"""What the pages for users tell them to type."""

import os
import re
import shlex
import signal
import subprocess
import sys

import pytest
import taxel
from harness.daemon import REPOSITORY, binary, die_with_parent
from harness.pages import DOCS, PAGES, commands, python_blocks


@pytest.fixture
def environment(folder):
    """Our programs in PATH, sockets in the test's folder, and the package as it is here."""
    path = os.pathsep.join([str(binary("taxel").parent), os.environ["PATH"]])
    run = folder / "run"
    return {**os.environ, "PATH": path, "RUNTIME_DIRECTORY": str(run), "PYTHONPATH": str(REPOSITORY / "python/src")}


def test_ten_minutes_without_hardware_run_line_by_line(folder, environment):
    page = DOCS / "first-steps.md"
    running, ran = [], 0
    try:
        for command in commands(page):
            if command.startswith(("cargo ", "export PATH", "pip install")):
                continue
            ran += 1
            if not command.endswith("&"):
                ended = subprocess.run(command, shell=True, cwd=folder, env=environment, capture_output=True, text=True)
                assert ended.returncode == 0, f"{command}\n{ended.stdout}{ended.stderr}"
                continue
            # Nothing waits here for what was started: who pastes the page does not either.
            words = shlex.split(command.removesuffix("&"))
            running.append(subprocess.Popen(words, cwd=folder, env=environment, preexec_fn=die_with_parent))
        (code,) = python_blocks(page)
        script = [sys.executable, "-c", code]
        ended = subprocess.run(script, cwd=folder, env=environment, capture_output=True, text=True)
        assert ended.returncode == 0, ended.stderr
        assert ended.stdout.startswith("(") and len(ended.stdout.splitlines()) >= 2, ended.stdout
    finally:
        for process in running:
            process.terminate()
        for process in running:
            process.wait()
    assert ran >= 15, "the page has lost its commands"


IN_PYTHON = [*PAGES, REPOSITORY / "python/README.md"]

# What blocks of python/README.md leave to the reader.
DISPLAY = """
import signal, sys, taxel
class display:
    @staticmethod
    def let_go() -> None:
        print({})
    @staticmethod
    def show(ids, levels) -> None:
        print(dict(zip(ids.tolist(), levels.tolist())))
"""


@pytest.mark.parametrize("page", ["docs/display-driver.md", "python/README.md"])
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM, "another hand"])
def test_a_driver_lets_go_however_it_ends(environment, page, how):
    (driver,) = [block for block in python_blocks(REPOSITORY / page) if "finally" in block]
    driver = DISPLAY + driver.replace("timeout=0.2", "timeout=600")  # it is not to let go for that
    with taxel.FakeDaemon() as daemon:
        environment.update(RUNTIME_DIRECTORY=str(daemon.folder), PYTHONUNBUFFERED="1")
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "preexec_fn": die_with_parent}
        with subprocess.Popen([sys.executable, "-c", driver], env=environment, **pipes) as running:
            daemon.wait_for_subscription()
            daemon.press([(0, 0, 1)])
            assert running.stdout.readline() == "{0: 1}\n"
            if how == "another hand":
                daemon.refuses = "region: the hand has no part `index`"
                daemon.restart()
            else:
                running.send_signal(how)
            said, complained = running.communicate()
    assert said == "{}\n"
    assert complained.count("taxel.errors.Refused: region: the hand has no part") == (how == "another hand")


@pytest.mark.parametrize("page", ["docs/display-driver.md", "python/README.md"])
def test_a_drivers_own_test_runs_without_a_hand(environment, page):
    (test,) = [block for block in python_blocks(REPOSITORY / page) if "FakeDaemon" in block]
    test = f"import taxel\n{test}"
    ended = subprocess.run([sys.executable, "-c", test], env=environment, capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr


def test_python_of_the_pages_has_no_errors_of_types(folder, environment):
    before = "import signal, sys, taxel\nfrom typing import Any\ndisplay: Any\nstore: Any\n"
    for number, page in enumerate(IN_PYTHON):
        for block, code in enumerate(python_blocks(page)):
            if "taxel." in code:
                (folder / f"{page.stem}_{number}_{block}.py").write_text(before + code)
    environment["MYPYPATH"] = environment["PYTHONPATH"]
    types = [sys.executable, "-m", "mypy", "--strict", "--cache-dir=/dev/null", *sorted(folder.glob("*.py"))]
    ended = subprocess.run(types, env=environment, capture_output=True, text=True)
    assert ended.returncode == 0 and len(types) > 10, ended.stdout + ended.stderr


def helps(words):
    """What --help says of a command and those below it."""
    said = subprocess.run([binary("taxel"), *words, "--help"], capture_output=True, text=True)
    assert said.returncode == 0, f"there is no `taxel {' '.join(words)}`: {said.stderr}"
    below = re.search(r"^Commands:\n((?:  .*\n)+)", said.stdout, flags=re.M)
    names = re.findall(r"^  ([a-z][a-z-]*) ", below[1], flags=re.M) if below else []
    return said.stdout + "".join(helps([*words, name]) for name in names if name != "help")


def test_every_command_of_every_page_has_the_options_that_it_is_told_with():
    known, seen = {}, 0
    for page in PAGES:
        for line in commands(page):
            for command in re.split(r"[|;&]", line):
                words = command.split()
                if words[:1] == ["sudo"]:
                    words = words[1:]
                if len(words) < 2 or words[0].rsplit("/", 1)[-1] != "taxel" or words[1].startswith("-"):
                    continue
                name = words[1]
                if name not in known:
                    known[name] = helps([name])
                options = {word.split("=")[0] for word in words[2:] if re.match("--[a-z]", word)}
                wrong = {option for option in options if not re.search(rf"(?<!\S){option}\b(?!-)", known[name])}
                assert not wrong, f"{page.name}: {line}\n`taxel {name}` has no {wrong}"
                seen += 1
    assert seen > 50


def test_every_page_is_a_chapter_of_the_book_and_every_chapter_a_page():
    chapters = re.findall(r"\]\(([^)]*)\)", (DOCS / "SUMMARY.md").read_text())
    pages = {page.name for page in DOCS.glob("*.md")} - {"SUMMARY.md"}
    assert set(chapters) == pages and len(chapters) == len(pages)


def heading_id(heading):
    words = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading).strip().lower()
    return re.sub(r"[^\w\- ]", "", words).replace(" ", "-")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_of_a_page_lead_somewhere(page):
    text = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.M | re.S)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if "://" in target:
            continue
        name, _, anchor = target.partition("#")
        there = page.parent / name if name else page
        assert there.exists(), f"{page.name}: {target}"
        if page.parent == DOCS:
            assert there.resolve().is_relative_to(DOCS), f"{page.name}: {target} leads out of the book"
        if anchor and there.suffix == ".md":
            headings = re.findall(r"^#+ (.*)$", there.read_text(), flags=re.M)
            assert anchor in map(heading_id, headings), f"{page.name}: {target}"
