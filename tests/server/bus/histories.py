"""What pages were shown over all their connections, what the car did, and the comparison with the log of the agent."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

AGE_SLACK_MS = 200


@dataclass
class Shown:
    """To one page, which dials again with the number of the newest event that it has."""

    events: list[dict[str, Any]] = field(default_factory=list)
    states: list[tuple[str, int, float]] = field(default_factory=list)  # run, when made, for how long connected [ms]

    @property
    def have_event(self) -> int | None:
        return self.events[-1]["n"] if self.events else None

    def has(self, n: int) -> bool:
        return self.have_event is not None and self.have_event >= n

    def add_state(self, state: Mapping[str, Any]) -> None:
        if (since_s := state["session"]["connected_for_s"]) is not None:
            self.states.append((state["server"]["boot"], state["server"]["time_ms"], since_s * 1000))


class Car:
    """The content of the file that `guarded_car` writes."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def lines(self) -> list[dict[str, Any]]:
        return [json.loads(line) for line in self._path.read_text().splitlines(keepends=True) if line.endswith("\n")]

    def speed_mps(self) -> float:
        tail = self._path.read_bytes()[-4000:].splitlines()
        return next(float(row["speed_mps"]) for row in map(_read, reversed(tail)) if "speed_mps" in row)


def _read(line: bytes) -> dict[str, Any]:
    with contextlib.suppress(ValueError):
        row = json.loads(line)
        return row if isinstance(row, dict) else {}
    return {}


def check_events(journal: list[dict[str, Any]], pages: Mapping[str, Shown]) -> None:
    """No event is lost or doubled, in the log and at each page."""
    numbers = [event["n"] for event in journal]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers))), "the journal has no hole"
    by_number = {event["n"]: event for event in journal}
    for name, page in pages.items():
        events = [event for event in page.events if event["n"] <= numbers[-1]]  # there may be newer ones by now
        seen = [event["n"] for event in events]
        assert seen == list(range(seen[0], numbers[-1] + 1)), f"{name}: lost, doubled or out of order"
        assert all(by_number[event["n"]]["at_ms"] == event["at_ms"] for event in events), name


def check_ages(journal: list[dict[str, Any]], pages: Iterable[Shown]) -> None:
    """No old state is shown as newer than it is.

    Each run of the agent connects once; from then on its states show for how long, to a tenth of a second.
    """
    states = [state for page in pages for state in page.states]
    connected_ms = [event["at_ms"] for event in journal if event["change"] == "connected"]
    runs = list(dict.fromkeys(run for run, _, _ in sorted(states, key=lambda one: one[1])))
    assert len(connected_ms) == len(runs)
    began_ms = dict(zip(runs, connected_ms, strict=True))
    younger = [made_ms - since_ms - began_ms[run] for run, made_ms, since_ms in states]
    print(f"{len(states)} states, {max(younger):.0f} ms younger at most, {-min(younger):.0f} ms older")
    assert max(younger) <= AGE_SLACK_MS, f"a state was shown {max(younger):.0f} ms younger than it was"
