"""Where the daemon's sockets are."""

import os
from pathlib import Path

SYSTEM = Path("/run/taxeld")


def running_socket(name: str) -> Path:
    """The socket of this name, such as images.sock, of the daemon that this user has started, or else of the system's.

    Of a service (RUNTIME_DIRECTORY) it is its own daemon's also while that is down: the system's is another hand. The same
    rule as taxeld's and taxel's own.
    """
    told = _told_folder()
    if told is not None:
        return told / name
    own = _default_folder() / name
    return own if own.exists() or not SYSTEM.is_dir() else SYSTEM / name


def _told_folder() -> Path | None:
    # The folder that systemd has made for a service.
    given = os.environ.get("RUNTIME_DIRECTORY")
    return Path(given.split(":")[0]) if given else None


def _default_folder() -> Path:
    if os.geteuid() == 0 or os.access(SYSTEM, os.W_OK):
        return SYSTEM
    runtime = os.environ.get("XDG_RUNTIME_DIR")
    # A relative one is to be ignored, as the standard says.
    return Path(runtime) / "taxeld" if runtime and os.path.isabs(runtime) else Path(f"/tmp/taxeld-{os.getuid()}")
