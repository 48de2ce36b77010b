"""What users pass, as the daemon takes it."""

import json
import math
import os
import time
from typing import Any, Dict, Optional, Sequence, Union

import numpy as np

Path = Union[str, bytes, "os.PathLike[str]", "os.PathLike[bytes]"]


def plain(value: Any) -> Any:
    """The same with Python's own numbers and lists for numpy's. TypeError or ValueError for what JSON has not."""
    return json.loads(json.dumps(value, default=_of_numpy, allow_nan=False))


def _of_numpy(value: Any) -> Any:
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    raise TypeError(f"{value!r} is nothing that the daemon is told: give numbers, texts, lists and dicts of them")


def wanted(
    raw: bool,
    status: bool,
    every: bool,
    max_rate_hz: Optional[float],
    profile: Optional[Dict[str, Any]],
    region: Optional[Sequence[str]],
) -> Dict[str, Any]:
    """The keys of a SUBSCRIBE; those that ask for nothing are left out."""
    if isinstance(region, (str, bytes)):
        raise TypeError(f"region is a list of parts of the hand: [{region!r}] instead of {region!r}")
    flags = {"raw": raw, "status": status, "every": every}
    keys: Dict[str, Any] = {key: True for key, value in flags.items() if value}
    rest = {"max_rate_hz": max_rate_hz, "profile": profile, "region": None if region is None else list(region)}
    keys.update({key: value for key, value in rest.items() if value is not None})
    asked: Dict[str, Any] = plain(keys)
    return asked


def deadline(timeout: Optional[float]) -> float:
    """When so many seconds are over, on the monotonic clock; infinity for None."""
    if timeout is None:
        return math.inf
    if math.isnan(timeout):
        raise ValueError("timeout is not a number; None waits for as long as it takes")
    return time.monotonic() + timeout
