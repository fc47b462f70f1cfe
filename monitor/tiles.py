"""The tiles of the home tab: each the worst of the checks it stands for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from monitor.check import BRIEF_LETTERS, Check, Finding, Verdict, unknown

_WORSE = [Verdict.OK, Verdict.UNKNOWN, Verdict.FAULT]  # not checked beats checked and good
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


def tiles(checks: Sequence[Check[Any]], findings: Mapping[str, Finding]) -> list[Tile]:
    """A tile for each tile label of `checks`, in their order; checks that do not apply count only where none does."""
    grouped: dict[str, list[Check[Any]]] = {}
    for check in checks:
        grouped.setdefault(check.tile_label, []).append(check)
    return [_tile(label, group, findings) for label, group in grouped.items()]


def _tile(label: str, group: Sequence[Check[Any]], findings: Mapping[str, Finding]) -> Tile:
    found = [(check, findings.get(check.id, NOT_YET)) for check in group]
    relevant = [pair for pair in found if pair[1].applies] or found
    verdict = max((finding.verdict for _, finding in relevant), key=_WORSE.index)
    those = [pair for pair in relevant if pair[1].verdict is verdict]
    text, brief = _words(verdict, those, len(relevant))
    return Tile(
        id=label.lower().replace(" ", "_"),
        label=label,
        verdict=verdict,
        text=text,
        brief=brief,
        checks=tuple(check.id for check in group),
    )


def _words(verdict: Verdict, those: Sequence[tuple[Check[Any], Finding]], of: int) -> tuple[str, str]:
    texts = list(dict.fromkeys(finding.text for _, finding in those))
    briefs = list(dict.fromkeys(finding.brief for _, finding in those))
    if len(texts) == 1:
        return texts[0], briefs[0]
    if verdict is Verdict.OK:
        return f"All {len(those)} in order", "OK"
    text = "; ".join(texts)
    if len(briefs) == 1 and verdict is Verdict.UNKNOWN:
        return text, briefs[0]
    plain, counted = ("FAULT", "FAULT") if verdict is Verdict.FAULT else ("not checked", "not checked:")
    brief = f"{counted} {len(those)} of {of}"
    return text, brief if len(brief) <= BRIEF_LETTERS else plain
