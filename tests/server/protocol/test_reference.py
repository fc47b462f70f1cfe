"""The page of all alarms and thresholds is that of the declarations."""

from __future__ import annotations

import pytest

from monitor import catalog
from monitor.catalog import CHECKS
from monitor.runner import IMPAIRED
from monitor.signals import SIGNALS
from server.protocol import reference
from tests.tree import PROJECT


def test_the_page_is_up_to_date() -> None:
    written = (PROJECT / "docs" / "alarms.md").read_text(encoding="utf-8")
    assert written == reference.text(), "Run: python -m server.protocol.reference > docs/alarms.md"


@pytest.mark.parametrize("alarm", [*dict.fromkeys(check.id.partition(".")[0] for check in CHECKS), IMPAIRED])
def test_every_alarm_is_on_it_once(alarm: str) -> None:
    rows = [line for line in reference.text().splitlines() if f"** `{alarm}`" in line or f"** `{alarm}.<" in line]
    assert len(rows) == 1
    cells = [cell.strip() for cell in rows[0].strip("|").split(" | ")]
    assert len(cells) == 8
    assert all(cells[at] for at in (0, 1, 2, 3, 7))


def test_every_threshold_is_on_it() -> None:
    page = reference.text()
    rates = {f"signals.{name}_hz" for name in SIGNALS}
    assert all(f"| `{name}` |" in page for name in catalog.schema().keys() - rates)
    assert "`signals.<signal>_hz`" in page
