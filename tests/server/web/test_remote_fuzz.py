"""Bodies of a compromised agent: the node refuses what is not of the declared types, and the page reads the rest."""

from __future__ import annotations

import copy
import json
import shutil
import subprocess
from collections.abc import Iterator
from typing import Any

import orjson
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from server.bus.bus import SUMMARY
from server.bus.nats_wire import Malformed
from server.web.remote_frames import _STATE, RemoteFrames, _errors, event
from tests.page.canned import alarm, live
from tests.server.web.test_remote_frames import CAR, LOGGED, NOW_MS
from tests.tree import PROJECT

READ = RemoteFrames(lambda: NOW_MS)
SPEEDING = alarm("speed_limit", "Speed above limit", priority="critical", place="dialog", sound="high")
STATE = live() | {"vehicle": "ocelot", "alarms": [SPEEDING], "suppressed": []}
JUNK = st.one_of(
    st.none(), st.booleans(), st.integers(-(1 << 70), 1 << 70), st.floats(allow_nan=False), st.text(max_size=8),
    st.sampled_from([[], {}, [None], [[]], {"x": None}, "x" * 5000, "__proto__", "</script>", -1, 1e300]),
)  # fmt: skip
SETTINGS = settings(
    max_examples=400, derandomize=True, deadline=None, database=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)  # fmt: skip


def places(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    if path:
        yield path
    inside = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for name, one in inside:
        yield from places(one, (*path, name))


def altered(whole: dict[str, Any]) -> st.SearchStrategy[dict[str, Any]]:
    """With some of its values replaced or left out."""
    change = st.tuples(st.sampled_from(list(places(whole))), st.one_of(st.just(...), JUNK))
    return st.lists(change, min_size=1, max_size=3).map(lambda changes: _changed(whole, changes))


def _changed(whole: dict[str, Any], changes: list[tuple[tuple[Any, ...], Any]]) -> dict[str, Any]:
    found = copy.deepcopy(whole)
    for path, value in changes:
        inside: Any = found
        try:
            for name in path[:-1]:
                inside = inside[name]
            if value is ...:
                del inside[path[-1]]
            else:
                inside[path[-1]] = value
        except (KeyError, IndexError, TypeError):  # an earlier change has taken it away
            continue
    return found


class Page:
    """The page's parser, in a process."""

    def __init__(self) -> None:
        node = shutil.which("node")
        assert node is not None
        program = str(PROJECT / "tests/page/message_reader.mjs")
        self.process = subprocess.Popen([node, program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def read(self, text: str) -> dict[str, Any]:
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write(f"{json.dumps(text)}\n")
        self.process.stdin.flush()
        answer: dict[str, Any] = json.loads(self.process.stdout.readline())
        return answer


@pytest.fixture(scope="module")
def page() -> Iterator[Page]:
    one = Page()
    yield one
    one.process.communicate()


@SETTINGS
@given(altered(STATE))
@example(STATE | {"alarms": [None]})
@example(STATE | {"alarms": [SPEEDING | {"priority": "catastrophic"}]})
def test_a_state_that_is_altered_is_refused_or_read_by_the_page(page: Page, state: dict[str, Any]) -> None:
    text = json.dumps(state)
    assert page.read(text)["threw"] == "", "also by a node that checks nothing"
    try:
        taken = READ("ocelot", "state", text, 0.0)
    except Malformed:
        return
    found = page.read(str(taken))
    assert found["threw"] == ""
    assert found["kind"] == "state" or "missing" in {kind for _, kind in _errors(_STATE, text)}, (
        "as from an older agent"
    )


@SETTINGS
@given(altered(LOGGED))
def test_an_event_that_is_altered_is_shown_and_stops_no_page(page: Page, altered: dict[str, Any]) -> None:
    found = event(copy.deepcopy(altered))
    if type(altered.get("n")) is int:
        assert found["n"] == altered["n"]
    assert isinstance(found["text"], str)
    assert type(found["at_ms"]) is int
    text = orjson.dumps({"kind": "events", "events": [found], "last": 7}).decode()
    assert page.read(text) == {"kind": "events", "threw": ""}


@SETTINGS
@given(altered(CAR))
def test_a_summary_that_is_altered_is_refused_or_read_by_the_page(page: Page, summary: dict[str, Any]) -> None:
    try:
        taken = json.loads(READ("ocelot", SUMMARY, json.dumps(summary), 0.0))
    except Malformed:
        return
    cars = {"kind": "cars", "time_ms": 1, "cars": [{"name": "ocelot", "age_s": 0.1, "summary": taken}]}
    assert page.read(json.dumps(cars)) == {"kind": "cars", "threw": ""}
