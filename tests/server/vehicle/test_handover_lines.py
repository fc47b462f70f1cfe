"""Who drives and the departure check, as they are read back."""

from __future__ import annotations

from typing import Any

import pytest

from monitor.values import Mode
from server.protocol.departure import DepartureState
from server.protocol.driving_state import ModeState, WhyUnknown
from server.vehicle.handover_lines import departure_line, driving_line


def mode(now: Mode, why: WhyUnknown | None = None, since_ms: int | None = 5) -> ModeState:
    return {"mode": now, "why": why, "since_ms": since_ms, "way_m": None, "source": "/mode", "open": []}


def check(state: Any, **counts: int) -> DepartureState:
    known = {"done": 10, "failed": 0, "not_applicable": 0, "of": 12, **counts}
    return {"state": state, **known, "by": "A. K. (Pixel)", "at_ms": 7}  # type: ignore[typeddict-item]


def test_who_drives() -> None:
    one = driving_line(mode("autonomous"))
    assert (one.key, one.title, one.text, one.since_ms) == ("driving:autonomous:", "The car drives itself", "", 5)
    one = driving_line(mode("unknown", "silent"))
    assert (one.title, one.text) == ("Who drives is not known", "The topic for it is silent.")
    assert one.since_ms is None, "since when nobody knows is no fact"
    assert one.key != driving_line(mode("unknown", "flickers")).key


@pytest.mark.parametrize(
    ("state", "title", "text"),
    [
        (check("none"), "No departure check was made", ""),
        (check("open"), "Departure check is not signed", "Begun by A. K. (Pixel): 10 of 12 items done."),
        (
            check("signed", not_applicable=2),
            "Departure check signed",
            "Signed by A. K. (Pixel): 10 of 12 items done, 2 not applicable.",
        ),
        (
            check("signed", failed=1),
            "Departure check signed with failed items",
            "Signed by A. K. (Pixel): 10 of 12 items done, 1 failed.",
        ),
    ],
    ids=["none", "open", "signed", "failed"],
)
def test_the_departure_check(state: DepartureState, title: str, text: str) -> None:
    one = departure_line(state, {})
    assert (one.title, one.text) == (title, text)


def test_an_item_that_turns_is_no_other_line_and_a_signature_is() -> None:
    before = departure_line(check("open"), {}).key
    assert before == departure_line(check("open", done=11), {}).key
    assert before != departure_line(check("signed"), {}).key
    tyres = departure_line(check("open", failed=1), {"tyres": "Tyres"})
    assert before != tyres.key, "it is read back anew"
    assert tyres.key != departure_line(check("open", failed=1), {"brake": "Brake"}).key, "so is another item"
    assert tyres.text == "Begun by A. K. (Pixel): 10 of 12 items done, 1 failed: Tyres."
