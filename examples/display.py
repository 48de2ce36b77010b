#!/usr/bin/env python3
"""A display driver in Python: presses actuators as the tactile images say.

    PYTHONPATH=crates/wire/python python3 examples/display.py /run/taxeld/images.sock

Put your hardware into drive(), which is called with the levels of all pressing actuators, 1 to LEVELS, whenever they
change. The display states how many it has: without that a level is one of the daemon's, whose number may change.
When no image has come for DEAD_MAN_S everything is let go: a display must not press on what the hand no longer
feels. When the daemon goes away the driver lets go at once and connects again.

SPDX-License-Identifier: Apache-2.0 OR MIT
"""

import os
import signal
import sys
import time
from typing import Dict

try:
    import taxel_reader
except ImportError:
    sys.exit("taxel_reader.py is not found: copy it beside this file, or set PYTHONPATH=crates/wire/python")

LEVELS = 8
ACTUATORS = 16
DEAD_MAN_S = 0.2
"""A few image periods; at 30 Hz an image comes every 0.033 s."""
RECONNECT_S = 0.5
ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
"""What ends the driver; a terminal that is closed sends SIGHUP."""


def drive(levels: Dict[int, int], why: str) -> None:
    """Your hardware: sets each actuator to its level, and lets go of those not named."""
    pressed = " ".join(f"{actuator}={level}" for actuator, level in sorted(levels.items()))
    print(f"{why}: {pressed or 'clear'}", flush=True)


class Display:
    """What the display shows now."""

    def __init__(self) -> None:
        self.levels: Dict[int, int] = {}

    def show(self, levels: Dict[int, int], why: str) -> None:
        """Drives the hardware where something changes."""
        if levels != self.levels:
            self.levels = levels
            drive(levels, why)


class Refused(Exception):
    """The daemon cannot give such images. Its own, which it goes on to send, are not of this display."""


def follow(reader: taxel_reader.Reader, display: Display) -> None:
    """Shows images until the connection ends, which raises an OSError, or the daemon refuses to make them."""
    reader.subscribe(profile={"levels": LEVELS, "actuators": ACTUATORS})
    last = time.monotonic()
    while True:
        try:
            message = reader.receive(timeout=0.02)
        except taxel_reader.DecodeError as error:
            if error.name == "major_version":
                raise
            print(f"display: a message was not usable: {error}", file=sys.stderr)
            message = None
        if isinstance(message, taxel_reader.Image):
            # The first may be from before the daemon has heard of LEVELS.
            own = [a for a in message.actuators if a.id < ACTUATORS]
            display.show({a.id: min(a.level, LEVELS) for a in own}, "image")
            last = time.monotonic()
        elif isinstance(message, taxel_reader.Text) and message.header.type == taxel_reader.EVENT:
            event = message.json()
            if event.get("event") == "refused":
                raise Refused(event.get("message"))
            print(f"taxeld: {event.get('message')}", file=sys.stderr)
        # Not by the time-out alone: messages that are not images must not hold the display.
        if time.monotonic() - last >= DEAD_MAN_S:
            display.show({}, "no image")


def end(*_: object) -> None:
    """Ends the driver. A second signal must not cut short that it lets go."""
    for number in ENDING:
        signal.signal(number, signal.SIG_IGN)
    sys.exit(0)


def main() -> int:
    """Follows the daemon, whenever there is one, until told to stop."""
    if len(sys.argv) != 2:
        print("usage: display.py SOCKET, such as /run/taxeld/images.sock; taxeld logs where it is", file=sys.stderr)
        return 2
    for number in ENDING:
        signal.signal(number, end)
    display = Display()
    try:
        while True:
            try:
                with taxel_reader.connect(sys.argv[1]) as reader:
                    follow(reader, display)
            except BrokenPipeError:
                raise
            except OSError as error:
                print(f"display: {error}", file=sys.stderr)
            drive({}, "closed")
            display.levels = {}
            time.sleep(RECONNECT_S)
    except (taxel_reader.DecodeError, Refused) as error:
        print(f"display: {error}", file=sys.stderr)
        return 1
    finally:
        drive({}, "stopped")


if __name__ == "__main__":
    try:
        sys.exit(main())
    except BrokenPipeError:
        # Whoever read the output has seen enough; nothing more is to be written to it, not even at the end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
