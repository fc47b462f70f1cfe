"""What the suites share: a tally of what they found, and servers as processes."""

from __future__ import annotations

import re
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from tests.page.processes import running, simulate
from tests.peers.environment import missing
from tests.peers.suites import BY_NAME, Suite
from tests.server.recording.made import record

DRIVE = "car_20160601T120000Z"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """They run other people's processes: none of them is in the gate."""
    for item in items:
        if item.get_closest_marker("peers"):
            item.add_marker(pytest.mark.field)


@dataclass(frozen=True)
class Tally:
    """Items tried and findings of a suite; `unexplained` are those for which its row has no reason."""

    suite: Suite
    kept: dict[str, Any]  # what goes into the log of the run, and from there into the table

    def tried(self, count: int = 1) -> None:
        self.kept["run"] += count

    def found(self, finding: str, item: str = "", *, is_advice: bool = False) -> None:
        """A finding about one item, in the suite's own text. The item did not pass, unless the finding is advice."""
        if not is_advice and (item or finding) not in self.kept["failed"]:
            self.kept["failed"].append(item or finding)
        for pattern, reason in self.suite.explained.items():
            if re.search(pattern, finding, re.DOTALL):
                self.kept["explained"][reason] = self.kept["explained"].get(reason, 0) + 1
                return
        self.unexplained.append(finding)

    @property
    def run(self) -> int:
        return int(self.kept["run"])

    @property
    def unexplained(self) -> list[str]:
        found: list[str] = self.kept["unexplained"]
        return found


@pytest.fixture
def tally(request: pytest.FixtureRequest, record_property: Callable[[str, object], None]) -> Tally:
    """The tally of the suite that the test's mark names, for the table; skipped where the suite is not installed."""
    suite = BY_NAME[request.node.get_closest_marker("peers").args[0]]
    kept: dict[str, Any] = {"suite": suite.name, "run": 0, "failed": [], "explained": {}, "unexplained": []}
    record_property("peers", kept)
    if why := missing(suite):
        pytest.skip(why)
    return Tally(suite, kept)


@pytest.fixture
async def base(tmp_path: Path) -> AsyncIterator[str]:
    """The address of a server that watches a simulated car and has a recording. It dials nobody but this machine."""
    data = tmp_path / "data"
    record(data / "recordings" / "car" / f"{DRIVE}.mcap", seconds=2.0, alarms=[(1.0, "critical")])
    victim = "tests.server.security.victim"
    async with running(*simulate()) as car, running(str(data), car.address, module=victim) as server:
        yield server.address
