"""The tiles of the home tab: each shows the worst of its checks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from monitor.check import BRIEF_LETTERS, Check, Finding, Verdict, unknown

NOT_YET = unknown("Not checked yet")


@dataclass(frozen=True, slots=True, kw_only=True)
class Tile:
    """One tile; the protocol's `checks` are these."""

    id: str
    label: str
    verdict: Verdict
    text: str
    brief: str  # at most 21 letters
    checks: tuple[str, ...]  # ids


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """The position of a tile on the home tab, and its checks."""

    id: str
    label: str
    checks: tuple[str, ...]  # ids


def places(checks: Sequence[Check[Any]]) -> tuple[Place, ...]:
    """One for each tile label of `checks`, in their order."""
    grouped: dict[str, list[str]] = {}
    for check in checks:
        grouped.setdefault(check.tile_label, []).append(check.id)
    return tuple(
        Place(id=label.lower().replace(" ", "_"), label=label, checks=tuple(ids)) for label, ids in grouped.items()
    )


def tiles(places: Sequence[Place], findings: Mapping[str, Finding]) -> list[Tile]:
    """A tile for each place; checks that do not apply count only where none does."""
    return [_tile_at(place, findings) for place in places]


def _tile_at(place: Place, findings: Mapping[str, Finding]) -> Tile:
    found = [findings.get(check_id, NOT_YET) for check_id in place.checks]
    if len(found) == 1:
        return _tile(place, found[0].verdict, found[0].text, found[0].brief)
    relevant = [finding for finding in found if finding.applies] or found
    verdict = _worst(relevant)
    text, brief = _texts(verdict, [finding for finding in relevant if finding.verdict is verdict], len(relevant))
    return _tile(place, verdict, text, brief)


def _tile(place: Place, verdict: Verdict, text: str, brief: str) -> Tile:
    return Tile(id=place.id, label=place.label, verdict=verdict, text=text, brief=brief, checks=place.checks)


def _worst(findings: Sequence[Finding]) -> Verdict:
    """Not checked beats checked and good."""
    worst = Verdict.OK
    for finding in findings:
        if finding.verdict is Verdict.FAULT:
            return Verdict.FAULT
        if finding.verdict is Verdict.UNKNOWN:
            worst = Verdict.UNKNOWN
    return worst


def _texts(verdict: Verdict, those: Sequence[Finding], of: int) -> tuple[str, str]:
    first = those[0]
    if all(finding.text == first.text for finding in those):
        return first.text, first.brief
    if verdict is Verdict.OK:
        return f"All {len(those)} OK", "OK"
    texts = list(dict.fromkeys(finding.text for finding in those))
    briefs = list(dict.fromkeys(finding.brief for finding in those))
    text = "; ".join(texts)
    if len(briefs) == 1 and verdict is Verdict.UNKNOWN:
        return text, briefs[0]
    plain, counted = ("FAULT", "FAULT") if verdict is Verdict.FAULT else ("not checked", "not checked:")
    brief = f"{counted} {len(those)} of {of}"
    return text, brief if len(brief) <= BRIEF_LETTERS else plain
