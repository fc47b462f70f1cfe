"""Does the car's own diagnostics report errors, stale components or warnings?

One alarm of each kind, with the components as its causes: a component that joins re-alarms an acknowledged one.
Components that no other check uses are included, so that everything the car reports is shown.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import partial

from monitor.check import (
    Action,
    AlarmSpec,
    Check,
    Finding,
    Limits,
    Place,
    Priority,
    Sound,
    absent,
    fault,
    fits_tile,
    ok,
)
from monitor.snapshot import Snapshot
from monitor.values import Component

OK_LEVEL, WARN, ERROR, STALE = 0, 1, 2, 3  # diagnostic_msgs/DiagnosticStatus
LEVELS = {WARN: "warns", ERROR: "error", STALE: "stale"}
NAMED = 3  # components in the text; the rest are counted


def find(levels: Collection[int], snapshot: Snapshot, limits: Limits, was_active: bool) -> Finding:
    if snapshot.get("diagnostics") is None and not snapshot.link.offers("diagnostics"):
        return absent("Diagnostics are not published")
    components = snapshot.need("diagnostics").components
    bad = [component for component in components if component.level in levels]
    if not bad:
        return ok(f"{len(components)} components report{_once(components, snapshot.now_s)}")
    bad.sort(key=lambda component: (component.level != ERROR, component.name))
    brief = bad[0].name if len(bad) == 1 else f"{len(bad)} parts"
    return fault(
        _text(bad),
        brief=brief if fits_tile(brief) else f"{len(bad)} part",
        causes=tuple(sorted({component.name for component in bad})),
    )


def _once(components: Sequence[Component], now_s: float) -> str:
    """Which of them are not missed when they fall silent: a level that was reported once may be old."""
    ages_s = [now_s - component.once_s for component in components if component.once_s is not None]
    if not ages_s:
        return ""
    return f", {len(ages_s)} of them once, {'up to ' if len(ages_s) > 1 else ''}{max(0.0, *ages_s):.0f} s ago"


def _text(bad: list[Component]) -> str:
    listed = [
        f"{component.name[:60]} {LEVELS[component.level]}{f': {component.message[:80]}' if component.message else ''}"
        for component in bad[:NAMED]
    ]
    more = f"; and {len(bad) - NAMED} more" if len(bad) > NAMED else ""
    return "; ".join(listed) + more


def _check(id: str, label: str, title: str, levels: Collection[int], priority: Priority) -> Check[Limits]:
    is_warning = priority is Priority.WARNING
    return Check(
        id=id,
        label=label,
        tile="Diagnostics",
        order=130,
        checked_when="Checked while Diagnostics is published and fresh.",
        alarm=AlarmSpec(
            title=title,
            priority=priority,
            place=Place.SNACKBAR if is_warning else Place.LIST,
            sound=Sound.MEDIUM if is_warning else Sound.LOW,
            needs_ack=is_warning,
            off_delay_s=10.0,  # ten reports of a 1 Hz publisher: a part at its own limit is intermittent
            actions=(Action.SHELVE, Action.ACKNOWLEDGE),
            advice="Reported by the car: check the named component.",
        ),
        limits=Limits,
        find=partial(find, frozenset(levels)),
        needs=frozenset({"diagnostics"}),
    )


CHECKS = (
    _check("diagnostics_error", "Diagnostics", "Component in error or stale", (ERROR, STALE), Priority.WARNING),
    _check("diagnostics_warn", "Diagnostics warnings", "Component warns", (WARN,), Priority.ADVISORY),
)
