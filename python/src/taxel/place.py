"""Where the daemon's sockets are."""

import os
from pathlib import Path

SYSTEM = Path("/run/taxeld")


def running_socket(name: str) -> Path:
    """The socket of this name, such as images.sock, of the daemon that this user has started, or else of the system's.

    The same rule as taxeld's and taxel's own.
    """
    own = _default_folder() / name
    return own if own.exists() or not SYSTEM.is_dir() else SYSTEM / name


def _default_folder() -> Path:
    # The folder that systemd has made for a service.
    given = os.environ.get("RUNTIME_DIRECTORY")
    if given:
        return Path(given.split(":")[0])
    if os.geteuid() == 0 or os.access(SYSTEM, os.W_OK):
        return SYSTEM
    runtime = os.environ.get("XDG_RUNTIME_DIR")
    # A relative one is to be ignored, as the standard says.
    return Path(runtime) / "taxeld" if runtime and os.path.isabs(runtime) else Path(f"/tmp/taxeld-{os.getuid()}")
