"""What an agent writes into the log of a car of commands that a web node passed on too late."""

from __future__ import annotations

from typing import Any

import pytest

from server.vehicle.outcomes import OF_NODES, LateCommands

WHY = "it came through a web node 1.2 s after its deadline."
Event = tuple[str, str, str | None]


class Car:
    """The log of ocelot; of no other car is there one."""

    def __init__(self) -> None:
        self.now_s = 0.0
        self.events: list[Event] = []
        self.late = LateCommands(lambda name: self.note if name == "ocelot" else None, now=lambda: self.now_s)

    def note(self, change: str, text: str, *, by: str | None = None, **more: Any) -> None:
        self.events.append((change, text, by))


def test_it_is_logged_with_its_kind_the_reason_and_the_name_that_the_node_gave() -> None:
    car = Car()
    car.late.note("ocelot", {"kind": "release", "by": "Ann"}, WHY)
    car.late.note("ocelot", {"kind": "slow_down", "by": "Ann"}, WHY)
    car.late.note("margay", {"kind": "release", "by": "Ann"}, WHY)
    car.late.note("ocelot", {"kind": "pause", "by": "\u202eAnn\n"}, WHY)
    car.late.note("ocelot", {"kind": "resume", "by": 7}, WHY)
    assert car.events == [
        ("late", f"“release” was not carried out: {WHY}", "Ann (not signed)"),
        ("slow_down", f"Slow-down refused: {WHY}", "Ann (not signed)"),
        ("late", f"“pause” was not carried out: {WHY}", "Ann (not signed)"),
        ("late", f"“resume” was not carried out: {WHY}", None),
    ]


@pytest.mark.parametrize("kind", ["present", "announces", "refresh", "outcome", "position", "a\nlong tale", 7, None])
def test_what_is_no_order_is_not_logged(kind: object) -> None:
    car = Car()
    car.late.note("ocelot", {"kind": kind, "by": "Ann"}, WHY)
    assert car.events == []


def test_a_flood_does_not_fill_the_log() -> None:
    car = Car()
    for _ in range(1000):
        car.late.note("ocelot", {"kind": "pause"}, WHY)
    assert len(car.events) == OF_NODES.at_once
    car.late.note("ocelot", {"kind": "slow_down"}, WHY)
    assert car.events.pop()[0] == "slow_down"  # others take no room from it
    car.now_s += 5.0
    for _ in range(1000):
        car.late.note("ocelot", {"kind": "pause"}, WHY)
    assert len(car.events) == OF_NODES.at_once + 5
