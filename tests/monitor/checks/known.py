"""Snapshots made of a few values, for tables of cases."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from monitor.catalog import CHECKS, AnyCheck
from monitor.check import Finding, unknown
from monitor.shell_facts import LinkFacts
from monitor.state import NotFresh, Reading, Snapshot


@dataclass(frozen=True, kw_only=True)
class Row:
    """A snapshot for each answer of a check; `unknown` is a reason where there is none.

    The test of a check names its own as `ANSWERS = {"its_id": Row(…)}`.
    """

    ok: Snapshot
    fault: Snapshot
    unknown: Snapshot | str
    limits: dict[str, float] = field(default_factory=dict)


LINK = LinkFacts(phase="monitoring", connected_s=0.0, bridge_answers=True)


def known(now_s: float = 100.0, *, age_s: float = 0.0, link: LinkFacts = LINK, **values: Any) -> Snapshot:
    """A snapshot with these signals, each `age_s` old with a horizon of 1 s; None leaves a signal out."""
    readings = {
        name: Reading(value=value, received_s=now_s - age_s, horizon_s=1.0, period_s=0.05, count=10)
        for name, value in values.items()
        if value is not None
    }
    return Snapshot(now_s=now_s, readings=readings, link=link)


def check_of(id: str) -> AnyCheck:
    return next(check for check in CHECKS if check.id == id)


def ask(id: str, snapshot: Snapshot, *, was_active: bool = False, **limits: float) -> Finding:
    """What a check finds, with some of its thresholds set; what is not fresh is UNKNOWN, as the runner has it."""
    check = check_of(id)
    try:
        return check.find(snapshot, check.limits(**limits), was_active)
    except NotFresh as why:
        return unknown(why.why, short=why.short)
