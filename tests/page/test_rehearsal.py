"""The page of `catgraph check --html`: opened from a file, without a network, whatever the recording holds."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from playwright.async_api import expect

from server.cli.main import main
from tests.page.conftest import Phone
from tests.server.recording.bags import Drive, write_ros1

SCRIPT = "</script><script>document.title='stolen'</script><img src=x onerror=\"document.title='stolen'\">"


def hostile(path: Path) -> Path:
    """Drives too fast for a while; its components and other topics speak HTML."""
    rows = [
        (n / 20, "/catvehicle/vel", "geometry_msgs/msg/Twist", {"linear": {"x": 14.0 if 200 < n < 300 else 5.0}})
        for n in range(600)
    ]
    status = {"status": [{"name": SCRIPT, "level": 2, "message": SCRIPT}]}
    rows += [(n + 0.01, "/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", status) for n in range(30)]
    rows += [(1.0, f"/{SCRIPT}", "std_msgs/msg/String", {"data": SCRIPT})]
    return write_ros1(path, Drive(messages=sorted(rows, key=lambda row: row[0])))


@pytest.mark.own_phone
async def test_alarms_plots_and_nothing_from_the_network(phone: Phone, tmp_path: Path) -> None:
    out = tmp_path / "drive.html"
    assert main(["check", str(hostile(tmp_path / "a.bag")), "--html", str(out)]) == 1
    requests: list[str] = []
    phone.page.on("request", lambda request: requests.append(request.url))
    await phone.page.goto(out.as_uri())
    await expect(phone.page.get_by_text("Speed above limit").first).to_be_visible()
    await expect(phone.page.locator(".uplot canvas").first).to_be_visible()
    assert await phone.page.title() != "stolen"
    assert requests == [out.as_uri()]
    assert await phone.page.evaluate("document.documentElement.scrollWidth <= innerWidth")


async def test_a_tap_on_the_next_alarm_shows_its_moment(phone: Phone, tmp_path: Path) -> None:
    out = tmp_path / "drive.html"
    main(["check", str(hostile(tmp_path / "a.bag")), "--html", str(out)])
    await phone.page.goto(out.as_uri())
    speed = phone.page.get_by_text(re.compile(r"^14\.00$"))
    await expect(speed.first).to_be_visible()  # it opens at the worst alarm
