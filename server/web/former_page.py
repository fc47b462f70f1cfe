"""What a page of before a change of names gets: it may be open while the server is updated, and must not be stuck."""

from __future__ import annotations

import orjson

from server.protocol.slow_down_state import FORMER_PHASES

_FORMER = {present: former for former, present in FORMER_PHASES.items()}


def state(payload: str) -> str:
    """A state with the former name of its slow-down's phase."""
    found = orjson.loads(payload)
    slow_down = found.get("decelerate")
    phase = slow_down.get("state") if isinstance(slow_down, dict) else None
    if not isinstance(phase, str) or phase not in _FORMER:
        return payload
    slow_down["state"] = _FORMER[phase]
    return orjson.dumps(found).decode()
