"""What is made from the declarations is up to date, and leaves nothing out."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

import pytest

from monitor import catalog
from monitor.catalog import CHECKS
from monitor.runner import IMPAIRED
from monitor.signals import SIGNALS
from server.protocol import reference, tables
from server.protocol.commands import BY_KIND
from server.protocol.page_messages import ReplayOrder
from server.protocol.tables import command_name, definitions
from tests.tree import PROJECT


def test_what_is_made_from_the_declarations_is_up_to_date() -> None:
    stale = [str(path.relative_to(PROJECT)) for path in reference.out_of_date(PROJECT)]
    assert stale == [], "Run: python -m server.protocol.reference --write"


def test_what_was_changed_by_hand_is_made_anew(tmp_path: Path) -> None:
    for name in reference.FILES:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes((PROJECT / name).read_bytes())
    assert reference.out_of_date(tmp_path) == {}
    for name, before, after in (
        ("docs/protocol.md", "| paused | boolean |", "| paused | string |"),
        (reference.TYPES, "paused: boolean;", "paused: string;"),
        ("docs/alarms.md", "**Speed above limit**", "**Speed**"),
    ):
        right = (tmp_path / name).read_text(encoding="utf-8")
        assert before in right
        (tmp_path / name).write_text(right.replace(before, after), encoding="utf-8")
        assert reference.out_of_date(tmp_path) == {tmp_path / name: right}
        (tmp_path / name).write_text(right, encoding="utf-8")


def test_every_type_has_its_table() -> None:
    page = (PROJECT / "docs" / "protocol.md").read_text(encoding="utf-8")
    shown = {name for name, schema in definitions().items() if "properties" in schema and "_" not in name}
    of_signals = {"Signals"} | {name for name in shown if name.endswith("Value")}
    orders = {command_name(one) for one in BY_KIND.values()} | {one.__name__ for one in get_args(ReplayOrder)}
    assert orders < shown
    assert [name for name in sorted(shown - of_signals - orders) if f"**{name}**" not in page] == []
    of_replay = {one.model_fields["do"].annotation.__args__[0] for one in get_args(ReplayOrder)}
    assert all(f"\n| {name} | " in page for name in (*SIGNALS, *BY_KIND, *of_replay))


def test_words_around_the_tables_stay() -> None:
    page = "Before.\n\n<!-- types: SavedFile -->\nold\n<!-- end -->\n\nAfter."
    made = tables.filled(page)
    assert made.startswith("Before.\n\n<!-- types: SavedFile -->\n")
    assert made.endswith("\n<!-- end -->\n\nAfter.")
    assert "| until_ms | number |" in made
    assert "old" not in made


@pytest.mark.parametrize("alarm", [*dict.fromkeys(check.id.partition(".")[0] for check in CHECKS), IMPAIRED])
def test_every_alarm_is_on_its_page_once(alarm: str) -> None:
    lines = reference.alarms_page().splitlines()
    rows = [line for line in lines if f"** `{alarm}`" in line or f"** `{alarm}.<" in line]
    assert len(rows) == 1
    cells = [cell.strip() for cell in rows[0].strip("|").split(" | ")]
    assert len(cells) == 9
    assert all(cells[at] for at in (0, 1, 2, 3, 4, 8))


def test_every_threshold_is_on_the_page_of_alarms() -> None:
    page = reference.alarms_page()
    rates = {f"signals.{name}_hz" for name in SIGNALS}
    assert all(f"| `{name}` |" in page for name in catalog.schema().keys() - rates)
    assert "`signals.<signal>_hz`" in page
