"""The bench's result: rows with a figure for each way of doing it, printed side by side."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

HEADS = ("", "reach", "catgraph", "floor", "today", "ours/floor", "today/ours")


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One measured thing; less is better in every row.

    `floor` is a bare client on the bridge, `today` one bridge connection a viewer; None where there is no such thing.
    """

    what: str
    unit: str
    catgraph: float
    floor: float | None = None
    today: float | None = None
    reach: float | None = None
    digits: int = 2

    @property
    def is_reached(self) -> bool | None:
        """Whether catgraph is where it should be; None where there is no goal."""
        return None if self.reach is None else self.catgraph <= self.reach

    def cells(self) -> tuple[str, ...]:
        """What stands in the columns of HEADS."""
        mark = {True: " ok", False: " MISSED", None: ""}[self.is_reached]
        return (
            f"{self.what} [{self.unit}]" if self.unit else self.what,
            "" if self.reach is None else f"≤ {self._spelt(self.reach)}{mark}",
            self._spelt(self.catgraph),
            self._spelt(self.floor),
            self._spelt(self.today),
            _ratio(self.catgraph, self.floor),
            _ratio(self.today, self.catgraph),
        )

    def _spelt(self, figure: float | None) -> str:
        return "–" if figure is None else f"{figure:,.{self.digits}f}".replace(",", " ")


@dataclass(frozen=True, slots=True, kw_only=True)
class Group:
    """Rows measured together, under a heading that states how."""

    name: str
    title: str
    rows: tuple[Row, ...]
    notes: tuple[str, ...] = ()

    def as_json(self) -> dict[str, Any]:
        """All of it, and of each row whether it is reached."""
        rows = [dataclasses.asdict(row) | {"is_reached": row.is_reached} for row in self.rows]
        return dataclasses.asdict(self) | {"rows": rows}


def printed(groups: Iterable[Group]) -> str:
    """All groups as one aligned table."""
    groups = list(groups)
    cells = [HEADS, *(row.cells() for group in groups for row in group.rows)]
    widths = [max(len(line[i]) for line in cells) for i in range(len(HEADS))]
    widths[0] += 2
    lines = [_line(HEADS, widths)]
    for group in groups:
        lines += ["", group.title]
        for row in group.rows:
            first, *rest = row.cells()
            lines.append(_line((f"  {first}", *rest), widths))
        lines += [f"    {note}" for note in group.notes]
    return "\n".join(lines)


def _line(cells: Iterable[str], widths: list[int]) -> str:
    first, *rest = cells
    return "  ".join([first.ljust(widths[0]), *(c.rjust(w) for c, w in zip(rest, widths[1:], strict=True))]).rstrip()


def _ratio(part: float | None, whole: float | None) -> str:
    if part is None or not whole:
        return ""
    ratio = part / whole
    return f"{ratio:,.0f} ×".replace(",", " ") if ratio >= 20 else f"{ratio:.2f} ×"
