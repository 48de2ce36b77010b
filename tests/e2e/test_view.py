"""`taxel view` on a terminal: what its keys do outside of the picture."""

import signal
import socket
import subprocess
import termios

import pyte
import pytest
from harness.bus import GROUP, free_udp_port
from harness.daemon import binary, eventually
from harness.recorder import messages
from harness.terminal import Screen, Terminal


def test_of_a_daemon_that_says_nothing_it_is_told_that_it_may_hang(folder):
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as hangs:
        hangs.bind(str(folder / "images.sock"))
        hangs.listen()
        with Terminal(folder, "view", "--socket", "images.sock") as terminal:
            terminal.wait_for("images.sock: taxeld says nothing; its log says what it does, and where it hangs, restart it")
            terminal.press("q")
            assert terminal.end() == 0


@pytest.mark.parametrize("by", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGQUIT], ids=lambda by: by.name)
def test_whoever_ends_it_finds_the_terminal_as_it_was(start, folder, by):
    daemon = start(sources=["sim:ball-grasp"] * 2, boards={"mode": "free-running"})
    with Terminal(folder, "view", "--socket", daemon.images) as terminal:
        terminal.wait_for("allegro")
        echoes = lambda: termios.tcgetattr(terminal.keys)[3] & (termios.ECHO | termios.ICANON)  # noqa: E731
        assert not echoes()
        terminal.process.send_signal(by)
        assert terminal.end() == 0
        assert echoes() == termios.ECHO | termios.ICANON


def test_a_key_records_into_a_file_named_by_the_time_and_ends_it(start, folder):
    daemon = start(sources=["sim:ball-grasp"] * 2, tick={"mode": "timer", "rate_hz": 30.0}, boards={"mode": "free-running"})
    with Terminal(folder, "view", "--socket", daemon.images) as terminal:
        terminal.wait_for("allegro")
        before = daemon.status()["images"]["made"]
        terminal.press("r")
        (file,) = eventually(lambda: list(folder.glob("taxel-*.mcap")), "no file is made")
        terminal.wait_for(file.name)
        daemon.wait_status(lambda status: status["images"]["made"] > before + 60, "the hand makes no images")
        terminal.press("r")
        terminal.wait_for("images and")
        terminal.press("q")
        assert terminal.end() == 0
    made = subprocess.run(
        [binary("taxel"), "convert", file.name, "frames.npz"], cwd=folder, capture_output=True, text=True
    )
    assert made.returncode == 0 and "frames" in made.stderr, made.stderr


def test_what_is_recorded_goes_on_in_another_file_of_the_buses_that_the_next_daemon_reads(start, folder):
    ports = [free_udp_port() for _ in range(2)]
    daemon = start([f"udp:{GROUP}:{ports[0]}?hops=0"], layout="uskin-module")
    with Terminal(folder, "view", "--socket", daemon.images) as terminal:
        terminal.wait_for("uskin-module")
        terminal.press("r")
        (first,) = eventually(lambda: list(folder.glob("taxel-*.mcap")), "no file is made")
        assert daemon.stop() == 0
        daemon.config.write_text(daemon.config.read_text().replace(str(ports[0]), str(ports[1])))
        daemon.start()
        second = first.with_name(f"{first.stem}-0001.mcap")
        eventually(lambda: messages(second), "no other file is begun")
        terminal.press("r")
        terminal.wait_for("images and")
        terminal.press("q")
        assert terminal.end() == 0
    assert sorted(folder.glob("*.mcap")) == [second, first]


def test_what_is_wrong_with_a_recording_is_said_in_the_picture_and_printed_behind_it(folder):
    def taxel(*arguments):
        subprocess.run([binary("taxel"), *arguments], cwd=folder, check=True, capture_output=True)

    taxel("sim", "tap", "--to", "log:tap.log", "--seconds", "3")
    taxel("convert", "tap.log", "tap.mcap")
    whole = (folder / "tap.mcap").read_bytes()
    (folder / "torn.mcap").write_bytes(whole[: len(whole) * 6 // 10])
    lines = (folder / "tap.log").read_text().splitlines(keepends=True)
    (folder / "half.log").write_text("".join(line for line in lines if " can0 " in line))
    (folder / "more.log").write_text("".join(lines) + lines[-1].replace(" can1 ", " left ").replace(" can0 ", " left "))
    for file, shown, printed in [
        ("torn.mcap", "torn off", "torn off"),
        ("half.log", *["nothing for bus can1; its taxels will be missing"] * 2),
        # How many frames that were takes its place at the end, which a busy machine may be the first to see.
        ("more.log", "left out", "interface left is left out"),
    ]:
        with Terminal(folder, "view", file) as terminal:
            terminal.wait_for(shown)
            # The rows come from above: the picture is whole once its last one is there.
            terminal.wait_for("? keys  q quit")
            # Said by the picture: nothing has written over it, and moved it.
            picture = terminal.screen.display
            assert picture[0].startswith(f" {file} ") and "? keys  q quit" in picture[-1], "\n".join(picture)
            assert not terminal.shows("taxel: "), "\n".join(picture)
            terminal.press("q")
            terminal.wait_for(f"taxel: {file}: ")
            terminal.wait_for(printed)
            assert terminal.end() == 0


def test_a_recording_that_is_of_another_hand_than_was_said_is_no_picture_but_an_error(folder):
    subprocess.run([binary("taxel"), "sim", "tap", "--to", "log:tap.log", "--seconds", "3"], cwd=folder, check=True)
    with Terminal(folder, "view", "tap.log", "--layout", "icub-forearm") as terminal:
        terminal.wait_for("taxel: tap.log: none of its frames is one of a board of layout icub-forearm")
        terminal.wait_for("`taxel doctor --scan log:tap.log`")
        assert terminal.end() == 1


def test_what_stood_on_a_terminal_without_alternate_screen_is_not_in_the_picture(folder):
    log = [binary("taxel"), "sim", "tap", "--to", "log:tap.log", "--seconds", "3"]
    subprocess.run(log, cwd=folder, check=True, capture_output=True)
    # pyte's own screen has no other one, as the console of Linux.
    screen = pyte.Screen(100, 30)
    pyte.Stream(screen).feed("a line of the shell before, which is as wide as the terminal is".ljust(98, ".") + "\r\n")
    pyte.Stream(screen).feed(("." * 70 + " of the shell before\r\n") * 28)
    with Terminal(folder, "view", "tap.log", screen=screen) as terminal:
        terminal.wait_for("? keys  q quit")
        assert not terminal.shows("of the shell before"), "\n".join(screen.display)
        terminal.press("q")
        assert terminal.end() == 0


def test_keys_are_asked_of_the_control_socket_that_is_named(start, folder):
    sockets = {"images": str(folder / "left-images.sock"), "control": str(folder / "left-control.sock")}
    daemon = start(sources=["sim:ball-grasp"] * 2, boards={"mode": "free-running"}, socket=sockets)
    for named, answer, paused in [
        ([], "--control", False),
        (["--control", daemon.control_path], "paused: every actuator has let go", True),
    ]:
        with Terminal(folder, "view", "--socket", daemon.images, *named) as terminal:
            terminal.wait_for("? keys  q quit")
            terminal.press("p")
            terminal.wait_for(answer)
            # The tick takes it up behind the answer.
            eventually(lambda: daemon.status()["paused"] == paused, "the daemon is not as the view says")
            terminal.press("q")
            assert terminal.end() == 0


def test_a_line_of_watch_that_the_terminal_is_too_narrow_for_ends_in_dots(start, folder):
    arguments = ["--hz", "--count", "1", "--socket", start().images]
    with Terminal(folder, "watch", *arguments, screen=Screen(40, 30)) as terminal:
        assert terminal.end() == 0
        (line,) = (line for line in terminal.screen.display if " here  latency" in line)
        assert line.rstrip().endswith("…"), line
