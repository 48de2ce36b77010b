"""A program on a terminal, and what it shows there."""

import fcntl
import os
import pty
import struct
import subprocess
import termios

import pyte
from harness.daemon import binary, die_with_parent, eventually


class Screen(pyte.Screen):
    """Keeps a program's picture apart from what it prints, as terminals do: pyte's own draws both on one screen."""

    ALTERNATE = 1049

    def set_mode(self, *modes, **private):
        super().set_mode(*modes, **private)
        self.turn(modes)

    def reset_mode(self, *modes, **private):
        super().reset_mode(*modes, **private)
        self.turn(modes)

    def turn(self, modes):
        if self.ALTERNATE in modes:
            self.erase_in_display(2)
            self.cursor_position()


class Terminal:
    """A program on a terminal, of 100x30 or as large as its screen. As a context: it is gone afterwards."""

    def __init__(self, folder, *arguments, screen=None):
        self.keys, theirs = pty.openpty()
        self.screen = screen or Screen(100, 30)
        fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", self.screen.lines, self.screen.columns, 0, 0))
        os.set_blocking(self.keys, False)
        self.process = subprocess.Popen(
            [binary("taxel"), *map(str, arguments)],
            cwd=folder,
            stdin=theirs,
            stdout=theirs,
            stderr=theirs,
            start_new_session=True,
            preexec_fn=die_with_parent,
            env={**os.environ, "TERM": "xterm-256color"},
        )
        os.close(theirs)
        # What is sent are changes of the picture: a letter that was there before is not sent again.
        self.stream = pyte.ByteStream(self.screen)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()
        os.close(self.keys)

    def shows(self, text):
        try:
            while part := os.read(self.keys, 65536):
                self.stream.feed(part)
        except (BlockingIOError, OSError):
            pass
        return any(text in line for line in self.screen.display)

    def wait_for(self, text):
        eventually(lambda: self.shows(text), lambda: f"{text} is not shown:\n" + "\n".join(self.screen.display))

    def press(self, key):
        os.write(self.keys, key.encode())

    def end(self):
        """Waits until the program has ended, while all that it still shows is taken; its status."""

        def ended():
            self.shows("")
            return self.process.poll() is not None

        eventually(ended, "it does not end")
        self.shows("")
        return self.process.returncode
