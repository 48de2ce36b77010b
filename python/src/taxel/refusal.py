"""Why taxeld would refuse a subscription or a request. Not all that it checks is checked here."""

import unicodedata
from typing import Any, Dict

_MOST = {"levels": 255, "actuators": 1024}
_COMMANDS = ("status", "rezero", "mark", "pause", "resume", "profile", "servo", "servos")


def of_profile(profile: Any) -> str:
    """Why it describes no display; empty where nothing here speaks against it."""
    if not isinstance(profile, dict):
        return f"profile = {profile!r} must be an object"
    for key, most in _MOST.items():
        value = profile.get(key, 1)
        if type(value) is not int or not 1 <= value <= most:
            return f"profile: {key} = {value!r} must be a whole number from 1 to {most}"
    return ""


def of_subscription(asked: Any, known: Dict[str, Any]) -> str:
    """Why nobody can subscribe so; empty where nothing here speaks against it. `known` are the keys but two."""
    if not isinstance(asked, dict):
        return f"subscription: {asked!r} must be an object"
    rate, region = asked.get("max_rate_hz"), asked.get("region")
    for key, value in asked.items():
        if key not in (*known, "profile", "region"):
            return f"subscription: unknown field `{key}`"
        if isinstance(known.get(key), bool) and not isinstance(value, bool):
            return f"subscription: {key} = {value!r} must be true or false"
    if rate is not None and not (type(rate) in (int, float) and rate >= 0.001):
        return f"subscription: max_rate_hz = {rate!r} must be a number from 0.001 on"
    if rate is not None and asked.get("every"):
        return f"subscription: every = true asks for all frames, max_rate_hz = {rate} for fewer; leave one out"
    if region is not None and not (isinstance(region, list) and region and all(isinstance(p, str) for p in region)):
        return f"region = {region!r} must be a list of parts, at least one; leave it out for the whole hand"
    return of_profile(asked["profile"]) if asked.get("profile") is not None else ""


def of_request(request: Any) -> str:
    """Why it cannot be done; empty where nothing here speaks against it."""
    if not isinstance(request, dict) or request.get("cmd") not in _COMMANDS:
        return f"{request!r} is no request: `cmd` must be one of {', '.join(_COMMANDS)}"
    if request["cmd"] == "mark":
        text = request.get("text")
        if not isinstance(text, str) or not 1 <= len(text.encode()) <= 500:
            return "a mark has 1 to 500 bytes of text"
        if any(unicodedata.category(character) == "Cc" for character in text):
            return "a mark is one line of text"
    if request["cmd"] == "servo":
        return _of_servo(request)
    if request["cmd"] == "servos":
        shares = request.get("pwm_percent")
        if not (isinstance(shares, dict) and shares):
            return f"pwm_percent = {shares!r} names no joint"
        return next(filter(None, map(_of_percent, shares.values())), "")
    return of_profile(request["profile"]) if request["cmd"] == "profile" and "profile" in request else ""


def _of_servo(request: Dict[str, Any]) -> str:
    torque, percent, hold_ms = (request.get(key) for key in ("torque", "pwm_percent", "hold_ms"))
    if hold_ms is not None:
        if not (type(hold_ms) in (int, float) and 20 <= hold_ms <= 10_000):
            return f"hold_ms = {hold_ms!r} is outside 20 to 10000 ms"
        if torque is not True:
            return 'hold_ms goes with "torque":true alone'
    if torque not in (None, True) and percent is not None or torque is percent is None:
        return "say torque (true or false), pwm_percent (-100 to 100), or torque true with the pwm_percent it begins with"
    return "" if percent is None else _of_percent(percent)


def _of_percent(percent: Any) -> str:
    if type(percent) in (int, float) and -100 <= percent <= 100:
        return ""
    return f"pwm_percent = {percent!r} is outside -100 to 100"
