"""Recorded events on the time line of a replay."""

from __future__ import annotations

import io
import os
from collections.abc import Callable
from pathlib import Path

import orjson
import pytest

from server.recording.catalog import annotations as annotation_store
from server.recording.read.read import Recording, open_recording
from server.replay import process, timeline
from server.replay.timeline import MOST_WORDS, NOTHING, TimelineEvents, read_timeline_events
from tests.server.recording.bags import Drive, write_ros1
from tests.server.recording.drive import story
from tests.server.recording.drive.story import BEGIN_MS, EVIL, mark, recorded
from tests.server.recording.export.ours import TOML


def test_marks_interventions_and_who_drove(tmp_path: Path) -> None:
    path = recorded(tmp_path, [*story.STORY, mark(100, "long", words="x" * 2000)])
    annotation_store.write_described(
        path,
        [
            {
                "intervention": "i1", "described_ms": BEGIN_MS, "what": "A box.", "category": None,
                "initiated_by": None, "by": None,
            }
        ],
    )  # fmt: skip
    found = read_timeline_events(lambda: open_recording([path]))
    assert [(row["mark"], row["at_s"]) for row in found.flags] == [("m1", 33.33), ("m3", 50.0), ("long", 100.0)]
    assert (found.flags[0]["words"], len(found.flags[-1]["words"])) == (EVIL, MOST_WORDS)
    assert found.interventions == [{"at_s": 80.0, "kind_of": "to_manual", "category": None, "what": "A box."}]
    assert [(span["mode"], span["from_s"], span["to_s"]) for span in found.modes] == [
        ("manual", 0.0, 10.0), ("autonomous", 10.0, 80.0), ("manual", 80.0, 120.0),
    ]  # fmt: skip


def test_a_recording_of_others_tells_nothing(tmp_path: Path) -> None:
    path = write_ros1(tmp_path / "bag.bag", Drive(messages=story.rows(3)))
    assert read_timeline_events(lambda: open_recording([path])) == TimelineEvents(flags=[])


def test_whatever_fails_it_is_replayed_without(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    path = recorded(tmp_path, story.STORY)

    def fails(*_: object) -> None:
        raise OverflowError("a number of a stranger")

    monkeypatch.setattr(timeline, "read_drive_events", fails)
    found = read_timeline_events(lambda: open_recording([path]))
    assert ([row["mark"] for row in found.flags], found.interventions) == (["m1", "m3"], ())
    monkeypatch.setattr(timeline, "marks_of", fails)
    assert read_timeline_events(lambda: open_recording([path])) == NOTHING
    assert "replayed without marks, interventions or driving modes" in caplog.text


def test_the_first_picture_does_not_wait_for_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = recorded(tmp_path, story.STORY)
    opening = {
        "path": str(path), "vehicle": "car", "name": "drive", "settings_version": 1, "settings": TOML,
        "at_s": 1.0, "sketch": [], "trends": None,
    }  # fmt: skip
    answers, answered_before = io.BytesIO(), list[bytes]()
    reads, ends = os.pipe()
    os.write(ends, orjson.dumps(opening) + b"\n")

    def read(again: Callable[[], Recording]) -> TimelineEvents:
        answered_before.append(answers.getvalue())
        os.close(ends)
        return read_timeline_events(again)

    monkeypatch.setattr(process, "read_timeline_events", read)
    with os.fdopen(reads, "rb") as orders:
        assert process._Process(orders, answers).run() == 0
    (before,) = answered_before
    assert b'"signals"' in before, "the state was sent"
    assert b"m1" not in before
