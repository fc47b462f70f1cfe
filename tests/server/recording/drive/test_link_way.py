"""The link along the way, against a drive whose truth is known."""

from __future__ import annotations

from pathlib import Path

import pytest

from server.recording.drive.facts import DriveFacts, read_facts
from server.recording.drive.link_way import LEAST_M, link_along
from server.recording.drive.motion import Motion
from server.recording.read.read import open_recording
from tests.server.recording.drive.story import in_two_parts, recorded


def test_each_stretch_has_its_delay_and_what_was_not_received(tmp_path: Path) -> None:
    """10 m/s all the time: the delay grows by 1 ms with each second, and so with each 10 m, up to 119 ms at 990 m."""
    with open_recording([recorded(tmp_path)]) as recording:
        found = link_along(read_facts(recording))
    assert [(one.from_m, one.to_m) for one in found[:3]] == [(0.0, 20.0), (20.0, 40.0), (40.0, 60.0)]
    assert found[-1].to_m == pytest.approx(1200, abs=15)
    assert [one.delay_s for one in found[:3]] == [pytest.approx(s, abs=0.002) for s in (0.0205, 0.0225, 0.0245)]
    assert (found[20].most_s, found[-1].delay_s) == (pytest.approx(0.061, abs=0.002), pytest.approx(0.119))
    blind = [(one.from_m, one.blind_s) for one in found if one.blind_s > 0.5]
    assert [at_m for at_m, _ in blind] == [600.0, 620.0], "4 s of 10 m/s"
    assert sum(one.blind_s for one in found) == pytest.approx(4.0, abs=0.2)


def test_between_two_parts_there_is_neither_delay_nor_loss(tmp_path: Path) -> None:
    with open_recording(in_two_parts(tmp_path)) as recording:
        found = link_along(read_facts(recording))
    assert found[-1].to_m == pytest.approx(1800, abs=15)
    assert sum(one.blind_s for one in found) == pytest.approx(4.0, abs=0.2)
    assert found[-1].delay_s == pytest.approx(0.077, abs=0.001), "the second part begins anew; 5 s of it"


def test_a_car_that_stood_has_no_way() -> None:
    motion = Motion(10.0)
    assert link_along(DriveFacts(start_ms=0, end_ms=10_000, log=None, motion=motion, late=[(0.0, 0.02)])) == []
    motion._by_speed.add(1.0, LEAST_M - 1)
    assert link_along(DriveFacts(start_ms=0, end_ms=10_000, log=None, motion=motion, late=[(0.0, 0.02)])) == []
