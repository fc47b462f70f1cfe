"""The alarm log on the disk: kept, or why not."""

from __future__ import annotations

from dataclasses import replace

import pytest

from monitor.check import Verdict
from monitor.runner import Monitor
from monitor.shell_facts import LinkFacts, Phase
from monitor.state import Snapshot
from tests.monitor.checks.known import ask

WHY = "The alarm log is not stored: the disk is full. 3 events are in memory only."


@pytest.mark.parametrize("phase", ["connecting", "failed", "monitoring", "lost"])
@pytest.mark.parametrize(("trouble", "verdict"), [(None, Verdict.OK), (WHY, Verdict.FAULT)])
def test_it_is_judged_with_and_without_a_link(phase: Phase, trouble: str | None, verdict: Verdict) -> None:
    found = ask("log_not_kept", Snapshot(now_s=1.0, link=LinkFacts(phase=phase, log_trouble=trouble)))
    assert found.verdict is verdict
    if trouble:
        assert found.text == trouble


def test_a_growing_number_of_waiting_events_is_no_new_alarm_and_a_pause_does_not_hide_it() -> None:
    monitor = Monitor()
    at = Snapshot(now_s=0.0, link=LinkFacts(phase="monitoring", log_trouble=WHY), paused=True, paused_since_s=0.0)
    transitions = [
        transition
        for second in range(60)
        for transition in monitor.step(
            replace(at, now_s=float(second), link=replace(at.link, log_trouble=WHY.replace("3", str(second))))
        )
        if transition.alarm_id == "log_not_kept"
    ]
    assert [(transition.change, transition.announces) for transition in transitions] == [("raised", True)]
