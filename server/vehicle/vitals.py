"""Whether one vehicle's session does its work, by the age of what it last did. Pure."""

from __future__ import annotations

from dataclasses import dataclass

from monitor.shell_facts import RecorderFacts

LATE_TICK_S = 1.0  # twenty ticks
LATE_STATE_S = 2.0  # pages cover their values by then
LATE_RECORDER_S = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Vitals:
    """The input of the health check. Ages in seconds."""

    tick_age_s: float  # since every check was last judged
    state_age_s: float | None  # since a state was made for the pages; None: no page is connected
    log_trouble: str | None  # why the event log is not kept, as a sentence
    recorder: RecorderFacts
    task_problems: tuple[str, ...]  # of supervised tasks, a sentence each


def problems(vitals: Vitals) -> list[str]:
    """What is wrong, a sentence each, worst first; empty: well."""
    found = []
    if vitals.tick_age_s > LATE_TICK_S:
        found.append(f"No check was evaluated for {vitals.tick_age_s:.1f} s.")
    if vitals.state_age_s is not None and vitals.state_age_s > LATE_STATE_S:
        found.append(f"No state was sent to pages for {vitals.state_age_s:.1f} s.")
    found += vitals.task_problems
    if vitals.log_trouble is not None:
        found.append(vitals.log_trouble)
    if vitals.recorder.trouble is not None:
        found.append(vitals.recorder.trouble)
    if vitals.recorder.behind_s > LATE_RECORDER_S:
        found.append(f"The recorder is {vitals.recorder.behind_s:.1f} s behind.")
    return found
