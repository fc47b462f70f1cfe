"""What a bridge sends again of a topic that is only compared: it is no repeat of a signal, and makes none older."""

from __future__ import annotations

from server.judge import pipeline
from server.judge.active_settings import ActiveSettings
from server.judge.comparisons import comparison_sources
from server.judge.settings import SettingsFile
from server.judge.sources.choice import choose
from server.vehicle.judgement import Judgement
from tests.server.vehicle.test_compared_cars import FIX, fix

CAR = {"/gps/fix": FIX, "/gps/filtered": FIX}


def judgement() -> Judgement:
    return Judgement(None, ActiveSettings(SettingsFile(None)), now=lambda: 0.0, on_transitions=lambda _: None)


def test_what_is_only_compared_comes_again_for_no_signal() -> None:
    chosen = choose(CAR).sources
    by_topic = pipeline.by_topic((*chosen.values(), *comparison_sources(CAR, chosen)))
    judged = judgement()
    judged.receive(by_topic["/gps/fix"], "/gps/fix", fix(0.0, 1.0), None, 1.0)
    judged.receive(by_topic["/gps/filtered"], "/gps/filtered", fix(0.0, 1.0), None, 1.0)
    for _ in range(3):
        judged.receive_again(by_topic["/gps/filtered"], "/gps/filtered", fix(0.0, 1.0), None, 2.0, came_s=1.0)
    assert judged.reception.tally("position").repeats == 0
    (other,) = judged.state.snapshot(2.0).compared.of("position")
    assert other.reading.count == 1, "it is not new"
    judged.receive_again(by_topic["/gps/fix"], "/gps/fix", fix(0.0, 1.0), None, 2.0, came_s=1.0)
    assert judged.reception.tally("position").repeats == 1


def test_the_age_of_what_is_only_compared_is_not_that_of_the_signal() -> None:
    chosen = choose(CAR).sources
    by_topic = pipeline.by_topic((*chosen.values(), *comparison_sources(CAR, chosen)))
    judged = judgement()
    at_s = 100.0
    judged.receive(by_topic["/gps/filtered"], "/gps/filtered", fix(0.0, 1.0), None, at_s)
    judged.receive(by_topic["/gps/fix"], "/gps/fix", fix(0.0, 1.0), None, at_s)
    judged.transport.older = lambda: {"/gps/filtered": (at_s, 50.0)}  # type: ignore[method-assign]
    before = judged.state.get("position")
    judged.correct_ages()
    assert judged.state.get("position") == before
