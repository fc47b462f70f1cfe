"""Nobody is kept out: every tab, screen, sheet and dialog in both themes as axe measures it, at every size."""

from __future__ import annotations

import pytest

from tests.page.barriers import fits_all, no_barrier
from tests.page.canned import Canned
from tests.page.conftest import Phone
from tests.page.screenshots import show

STATES = {
    "home": ("home-lower", "chart", "home-fault", "home-warning", "paused"),
    "silence": ("home-stale", "server-silent", "link-lost", "no-messages"),
    "slow-down": ("slow-down-arm", "slow-down-release", "slow-down-in-dialog", "countdown"),
    "map": ("map-tiles", "map-stale", "map-none"),
    "files": ("files", "files-menu", "mail", "outbox", "replay"),
    "settings": ("settings", "topic", "preferences"),
    "alarms": ("alarms", "check", "check-unknown"),
    "menu": ("menu", "stop", "scan", "signals", "alarm-log"),
    "connect": ("connect", "connect-saved", "connect-failed"),
}


@pytest.mark.parametrize("states", STATES)
async def test_nothing_keeps_anybody_out(phone: Phone, canned: Canned, states: str) -> None:
    """A small phone, a large one, both ways, a tablet, and a desktop at once and twice its size."""
    for name in STATES[states]:
        await show(canned, phone.page, name)
        await no_barrier(phone.page, name)
        await fits_all(phone.page, name)
