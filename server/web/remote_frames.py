"""How a web node reads frames and events of an agent: no page gets what is not of this vehicle, or not
of the declared types.

A value that is not declared, as a priority of a newer version, is accepted, and a field that an older version does not
have may be missing: the page handles both.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import orjson
from pydantic import TypeAdapter, ValidationError

from server.bus import nats_wire as wire
from server.bus.bus import SUMMARY
from server.protocol.alarm_state import LogEvent
from server.protocol.cars_state import CarSummary
from server.protocol.slow_down_state import FORMER_PHASES
from server.protocol.state import LiveState

Place = tuple[int | str, ...]  # in a body, as ("alarms", 0, "title")

LONGEST_SUMMARY = 6000  # bytes; it is sent to every page
_SUMMARY: TypeAdapter[CarSummary] = TypeAdapter(CarSummary)
_STATE: TypeAdapter[LiveState] = TypeAdapter(LiveState)
_EVENT: TypeAdapter[LogEvent] = TypeAdapter(LogEvent)
# Without these parts of a state, and without a part of an alarm, no page can show the car.
PARTS = "server session link signals nearest checks alarms limits recording decelerate control".split()
NEEDED: frozenset[Place] = frozenset([("signals", "speed"), *((name,) for name in PARTS)])
ALARMS = frozenset(("alarms", "suppressed"))
# What a page needs of each event, and what it gets where an event has it not, or as another type.
_UNREAD = {"at_ms": 0, "alarm": None, "change": "unread", "text": "This event of the agent cannot be read."}


class RemoteFrames:
    """Reads them. `wall_ms`: the time of day of this node."""

    def __init__(self, wall_ms: Callable[[], int]) -> None:
        self._wall_ms = wall_ms

    def __call__(
        self, vehicle: str, kind: str, payload: str | bytes, age_s: float, excess_s: float = 0.0
    ) -> str | bytes:
        """What pages get; `age_s`: since it was put, at most, and likely less by `excess_s`. Raises Malformed."""
        if kind == SUMMARY:
            return summary(payload, self._wall_ms() - round(1000 * age_s))
        if kind == "state":
            return state(vehicle, payload, self._wall_ms() - round(1000 * age_s), round(1000 * excess_s))
        return scan(payload)


def state(vehicle: str, payload: str | bytes, time_ms: int, excess_ms: int = 0) -> str:
    """The state as if it had been made here: `time_ms` is the time of day by this node's clock when it was put.

    The page reads the delay of a frame from it; the clock of the car may show another time. It was put no earlier than
    that, likely `excess_ms` later: from there the page counts the time of an order. Raises Malformed.
    """
    found = _loaded(payload)
    if found.get("kind") != "state" or found.get("vehicle") != vehicle or not isinstance(found.get("server"), dict):
        raise wire.Malformed(f"no state of {vehicle}")
    wrong = {str(loc[0]) if loc else "body" for loc, kind in _errors(_STATE, payload) if not _may_lack(loc, kind)}
    if wrong:
        raise wire.Malformed(f"a state with a wrong {', '.join(sorted(wrong))}"[:200])
    found = {name: found[name] for name in LiveState.__annotations__ if name in found}
    found["server"] |= {"time_ms": time_ms, "excess_ms": excess_ms}
    if isinstance(slow_down := found.get("decelerate"), dict):
        _rename(slow_down, "state")
    try:
        return orjson.dumps(found).decode()
    except (TypeError, ValueError) as error:  # nested too deeply to be written
        raise wire.Malformed(str(error)) from None


def summary(payload: str | bytes, time_ms: int) -> str:
    """The summary as if it had been made here, at `time_ms` by this node's clock; the clock of the car may show another
    time. What is not declared is left out: the agent may be newer. Raises Malformed."""
    if len(payload) > LONGEST_SUMMARY:
        raise wire.Malformed(f"a summary of {len(payload)} bytes")
    try:
        loaded = _loaded(payload)
        _rename(loaded, "slow_down")
        found = _SUMMARY.validate_python(loaded)
        if (made_ms := found.get("time_ms")) is not None:
            _shift(found, time_ms - made_ms)
        return orjson.dumps(found).decode()
    except (ValidationError, TypeError, ValueError) as error:  # a number may be too large to be written
        raise wire.Malformed(str(error)[:200]) from None


def event(found: dict[str, Any]) -> dict[str, Any]:
    """The event as pages get it: what is of another type than declared is left out, and no event is."""
    try:
        errors = _errors(_EVENT, orjson.dumps(found))
    except TypeError:  # nested too deeply to be written
        return {"n": found.get("n"), **_UNREAD}
    for loc, kind in errors:
        if not loc:  # nested too deeply to be read
            return {"n": found.get("n"), **_UNREAD}
        name = str(loc[0])
        if kind != "missing" or len(loc) > 1:
            found.pop(name, None)
        if name in _UNREAD:
            found[name] = _UNREAD[name]
    return found


def _errors(adapter: TypeAdapter[Any], payload: str | bytes) -> list[tuple[Place, str]]:
    """Where a body is not of the declared type, and the kind of each mistake."""
    try:
        adapter.validate_json(payload, strict=True)
    except ValidationError as error:
        found = error.errors(include_url=False, include_context=False)
        texts = {
            one["loc"] for one in found if one["type"] in ("literal_error", "enum") and isinstance(one["input"], str)
        }
        # Of a union with a literal each member has an error of its own.
        unions = {loc[:-1] for loc in texts if str(loc[-1]).startswith("literal[")}
        return [
            (one["loc"], one["type"])
            for one in found
            if one["loc"] not in texts and not (isinstance(one["input"], str) and one["loc"][:-1] in unions)
        ]
    return []


def _may_lack(loc: Place, kind: str) -> bool:
    """Whether this mistake is a field that an older agent does not have."""
    return kind == "missing" and loc[0] not in ALARMS and loc not in NEEDED


def _rename(found: dict[str, Any], field: str) -> None:
    """Put the present name of a phase in place of a former one."""
    if isinstance(phase := found.get(field), str):
        found[field] = FORMER_PHASES.get(phase, phase)


def _shift(found: CarSummary, by_ms: int) -> None:
    """Put all times of day forward."""
    found["time_ms"] += by_ms
    if (worst := found["worst"]) is not None:
        worst["raised_ms"] += by_ms
    if (item := found.get("attention")) is None:
        return
    item["since_ms"] += by_ms
    for one in (item["assigned"], item["offered"]):
        if one is not None:
            one["since_ms"] += by_ms
    if item["escalates_ms"] is not None:
        item["escalates_ms"] += by_ms
    if item["escalated_ms"] is not None:
        item["escalated_ms"] += by_ms


def scan(payload: str | bytes) -> bytes:
    """As it is: the page reads it with care. Raises Malformed."""
    if isinstance(payload, str):
        raise wire.Malformed("a scan is no text")
    return payload


def _loaded(payload: str | bytes) -> dict[str, Any]:
    try:
        found = orjson.loads(payload)
    except orjson.JSONDecodeError as error:
        raise wire.Malformed(str(error)) from None
    if not isinstance(found, dict):
        raise wire.Malformed("no object")
    return found
