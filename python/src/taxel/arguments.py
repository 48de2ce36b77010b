"""What users pass, as the daemon takes it."""

import math
import os
import time
from typing import Any, Dict, Optional, Sequence, Union

Path = Union[str, "os.PathLike[str]"]


def wanted(
    raw: bool,
    status: bool,
    every: bool,
    max_rate_hz: Optional[float],
    profile: Optional[Dict[str, Any]],
    region: Optional[Sequence[str]],
) -> Dict[str, Any]:
    """The keys of a SUBSCRIBE; those that ask for nothing are left out."""
    flags = {"raw": raw, "status": status, "every": every}
    keys: Dict[str, Any] = {key: value for key, value in flags.items() if value}
    rest = {"max_rate_hz": max_rate_hz, "profile": profile, "region": None if region is None else list(region)}
    keys.update({key: value for key, value in rest.items() if value is not None})
    return keys


def deadline(timeout: Optional[float]) -> float:
    """When so many seconds are over, on the monotonic clock; infinity for None."""
    return math.inf if timeout is None else time.monotonic() + timeout
