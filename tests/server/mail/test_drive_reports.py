"""The report of each drive by mail, where that is wished."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from server.app.build import build
from server.app.config import Config
from server.app.lifespan import lifespan
from server.mail.drive_reports import DriveReports
from server.mail.mailer import Mailer
from server.mail.settings import BadMailSetting, MailSettings, MailSettingsFile, checked
from server.recording.folder import WRITING, part_id
from server.web.services import Services
from tests.server.mail.mailing import Clock, Shelf
from tests.server.recording.made import record

TO = ("ann@example.org",)
QUIET_S = 0.05


async def until(is_so: object, within_s: float = 10.0) -> None:
    async with asyncio.timeout(within_s):
        while not is_so():  # type: ignore[operator]
            await asyncio.sleep(0.01)


class Watch:
    """Seconds, moved by hand."""

    s = 0.0

    def __call__(self) -> float:
        return self.s


@pytest.mark.virtual_time
@pytest.mark.parametrize("report_to", [TO, ()])
async def test_a_drive_that_ended_is_mailed_once_where_wished(tmp_path: Path, report_to: tuple[str, ...]) -> None:
    shelf, watch = Shelf(tmp_path / "car"), Watch()
    mailer = Mailer(tmp_path / "mail", shelf, wall_ms=Clock())
    await mailer.start()
    mailer.settings = replace(MailSettings(host="localhost", port=1, sender="car@example.org"), report_to=report_to)
    reports = DriveReports(mailer, now=watch, quiet_s=QUIET_S)
    reports.start()
    try:
        reports.finished(shelf.put("20261119T140303Z"))
        going_on = shelf.folder / f"20261119T140303Z_p2{WRITING}"
        going_on.write_bytes(b"")
        watch.s = 100.0
        await asyncio.sleep(4 * QUIET_S)
        assert await mailer.letters(None, 10) == []  # another part is being written: the drive goes on
        going_on.unlink()
        reports.finished(shelf.put("20261119T140303Z_p2"))
        await asyncio.sleep(0)
        watch.s = 200.0
        if report_to:
            await until(lambda: not reports._waiting)
        else:
            await asyncio.sleep(4 * QUIET_S)
        letters = await mailer.letters(None, 10)
        assert [(one.order.recordings, one.order.format, one.order.to) for one in letters] == (
            [(("20261119T140303Z",), "html", TO)] if report_to else []
        )
    finally:
        await reports.stop()
        await mailer.stop()


@pytest.mark.virtual_time
async def test_what_waits_at_the_end_of_the_server_is_kept(tmp_path: Path) -> None:
    shelf = Shelf(tmp_path / "car")
    mailer = Mailer(tmp_path / "mail", shelf, wall_ms=Clock())
    await mailer.start()
    mailer.settings = replace(MailSettings(host="localhost", port=1, sender="car@example.org"), report_to=TO)
    before, after = "car_20261119T140303Z", "car_20261119T141500Z"
    reports = DriveReports(mailer, now=Watch())
    reports.start()
    reports.finished(shelf.put(before))
    await until(lambda: reports._waiting)
    await reports.stop()
    assert await mailed(reports) == []  # the drive may go on after the next start
    resumed = [{"n": 1, "at_ms": 5, "alarm": None, "change": "started", "resumes": True}]
    path = record(shelf.folder / f"{after}.mcap", seconds=2.0, own=resumed)
    watch = Watch()
    reports = DriveReports(mailer, now=watch)
    reports.start()
    await until(lambda: reports._waiting)
    reports.finished(path)
    await until(lambda: len(reports._waiting) == 2)
    watch.s = 100.0
    await reports.stop()
    assert await mailed(reports) == [(before, after)]  # once, as it was over
    assert not reports._waiting
    await mailer.stop()


def test_the_setting_is_checked_and_kept(tmp_path: Path) -> None:
    body = {"host": "localhost", "port": 25, "sender": "car@example.org", "report_to": [" ann@example.org ", ""]}
    found = checked(body, MailSettings())
    assert (found.report_to, MailSettings().report_to) == (TO, ())
    file = MailSettingsFile(tmp_path / "mail.toml")
    file.write(found)
    assert file.read() == found
    for bad in (["no address"], ["a@b.org"] * 30, "ann@example.org", [5]):
        with pytest.raises(BadMailSetting) as refused:
            checked({**body, "report_to": bad}, MailSettings())
        assert refused.value.field == "report_to"


def test_a_drive_is_reported_when_its_file_is_closed_and_not_when_a_mark_comes_late(tmp_path: Path) -> None:
    called: list[str] = []

    class Part:
        def __init__(self, name: str) -> None:
            self._name = name

        def __getattr__(self, what: str) -> Callable[..., None]:
            return lambda *_: called.append(f"{self._name}.{what}")

    names = ("recordings", "marks", "drive_reports", "uploader")
    running: Any = SimpleNamespace(**{name: Part(name) for name in names})
    Services.recording_finished(running, tmp_path)
    assert called == ["recordings.add", "marks.finished", "drive_reports.finished", "uploader.rouse"]
    called.clear()
    Services.marks_changed(running, tmp_path)
    assert called == ["recordings.reread_annotations", "uploader.rouse"]


async def test_a_drive_whose_server_was_killed_is_reported_too(tmp_path: Path) -> None:
    """What the last run left is recovered, and then its drive has ended as any other."""
    left = tmp_path / "recordings" / "car" / f"car_20261119T140303Z{WRITING}"
    record(left, seconds=2.0)
    (tmp_path / "mail").mkdir()
    file = MailSettingsFile(tmp_path / "mail" / "settings.toml")
    file.write(replace(MailSettings(host="localhost", port=1, sender="car@example.org"), report_to=TO))
    running, journal, storage = build(Config(data=tmp_path), now=Watch(), wall_ms=Clock(), checks=None)
    async with lifespan(running, journal, storage):
        reports = running.drive_reports
        assert reports is not None
        await until(lambda: reports._waiting)
        ((_, drive),) = reports._waiting.items()
        assert drive.ids == ["car_20261119T140303Z"]


@contextlib.asynccontextmanager
async def reporting(
    tmp_path: Path, shelf: Shelf, watch: Watch, quiet_s: float = QUIET_S
) -> AsyncIterator[DriveReports]:
    mailer = Mailer(tmp_path / "mail", shelf, wall_ms=Clock())
    await mailer.start()
    mailer.settings = replace(MailSettings(host="localhost", port=1, sender="car@example.org"), report_to=TO)
    reports = DriveReports(mailer, now=watch, quiet_s=quiet_s)
    reports.start()
    try:
        yield reports
    finally:
        await reports._supervisor.stop()  # as a kill: what waits is not ordered
        await mailer.stop()


async def mailed(reports: DriveReports) -> list[tuple[str, ...]]:
    """The recordings of each mail, the oldest first."""
    return [one.order.recordings for one in (await reports._mailer.letters(None, 100))[::-1]]


async def test_each_drive_has_one_mail(tmp_path: Path) -> None:
    """Yesterday's recovered drive is mailed at once though today's is being written."""
    shelf, watch = Shelf(tmp_path / "car"), Watch()
    yesterday = [part_id("car_20261118T140303Z", part) for part in range(1, 46)]
    today = shelf.folder / f"car_20261119T140303Z{WRITING}"
    record(today, seconds=2.0)
    async with reporting(tmp_path, shelf, watch) as reports:
        for id in [*yesterday, "car_20261119T140303Z_p2"]:
            reports.finished(shelf.put(id))
        await until(lambda: len(reports._waiting) == 1)
        assert await mailed(reports) == [(yesterday[0],)]
        today.unlink()
        watch.s = 100.0
        await until(lambda: not reports._waiting)
        assert await mailed(reports) == [(yesterday[0],), ("car_20261119T140303Z_p2",)]


async def test_a_drive_that_goes_on_after_a_restart_is_mailed_as_one_when_it_ends(tmp_path: Path) -> None:
    shelf, watch = Shelf(tmp_path / "car"), Watch()
    before, after = "car_20261119T140303Z", "car_20261119T141500Z"
    going_on = shelf.folder / f"{after}{WRITING}"
    record(going_on, seconds=2.0, own=[{"n": 1, "at_ms": 5, "alarm": None, "change": "started", "resumes": True}])
    async with reporting(tmp_path, shelf, watch) as reports:
        reports.finished(shelf.put(before))
        watch.s = 100.0
        await until(lambda: (shelf.folder, after) in reports._resumed)
        await asyncio.sleep(4 * QUIET_S)
        assert await mailed(reports) == []  # the server was started again, and the drive goes on
        reports.finished(going_on.rename(shelf.folder / f"{after}.mcap"))
        await until(lambda: len(reports._waiting) == 2)
        watch.s = 200.0
        await until(lambda: not reports._waiting)
        assert await mailed(reports) == [(before, after)]


@pytest.mark.parametrize("resumed", [False, True])
async def test_what_was_completed_and_not_yet_announced_is_mailed_with_the_rest(tmp_path: Path, resumed: bool) -> None:
    shelf, watch = Shelf(tmp_path / "car"), Watch()
    before = "car_20261119T140303Z"
    after = "car_20261119T141500Z" if resumed else part_id(before, 2)
    going_on = shelf.folder / f"{after}{WRITING}"
    record(going_on, seconds=2.0, own=[{"n": 1, "at_ms": 5, "alarm": None, "change": "started", "resumes": True}])
    mailer = Mailer(tmp_path / "mail", shelf, wall_ms=Clock())
    await mailer.start()
    mailer.settings = replace(MailSettings(host="localhost", port=1, sender="car@example.org"), report_to=TO)
    reports = DriveReports(mailer, now=watch)
    try:
        reports._take(shelf.folder, shelf.put(before).stem)
        watch.s = 100.0
        await reports._mail_all(reports._is_over)
        path = going_on.rename(shelf.folder / f"{after}.mcap")
        await reports._mail_all(reports._is_over)
        assert await mailed(reports) == []
        reports._take(shelf.folder, path.stem)
        await reports._mail_all(reports._is_over)
        assert await mailed(reports) == []  # it has just ended
        watch.s = 200.0
        await reports._mail_all(reports._is_over)
        assert await mailed(reports) == [(before, after) if resumed else (before,)]
        assert not reports._waiting
    finally:
        await mailer.stop()


async def test_what_waits_is_mailed_after_kills(tmp_path: Path) -> None:
    shelf, watch = Shelf(tmp_path / "car"), Watch()
    id, name = "car_20261118T140303Z", tmp_path / "mail" / "reports.json"
    async with reporting(tmp_path, shelf, watch) as reports:
        reports.finished(shelf.put(id))
        await until(name.exists)
    for _ in range(2):
        async with reporting(tmp_path, shelf, watch) as reports:
            await until(lambda: reports._waiting)
    watch.s = 100.0
    async with reporting(tmp_path, shelf, watch, quiet_s=0.0) as reports:
        await until(lambda: id.encode() not in name.read_bytes())
        assert await mailed(reports) == [(id,)]
    async with reporting(tmp_path, shelf, watch, quiet_s=0.0) as reports:
        assert await mailed(reports) == [(id,)]


@pytest.mark.parametrize("content", [b"", b"[1]", b'{"/a": 5, "/b": ["../x", 7]}', b"\xff"], ids=repr)
async def test_a_file_of_somebody_else_does_no_harm(tmp_path: Path, content: bytes) -> None:
    shelf = Shelf(tmp_path / "car")
    (tmp_path / "mail").mkdir()
    (tmp_path / "mail" / "reports.json").write_bytes(content)
    async with reporting(tmp_path, shelf, Watch()) as reports:
        reports.finished(shelf.put("car_20261118T140303Z"))
        await until(lambda: reports._kept)
        assert not reports.problems()


async def test_what_the_outbox_does_not_take_is_tried_again(tmp_path: Path) -> None:
    shelf, watch = Shelf(tmp_path / "car"), Watch()
    async with reporting(tmp_path, shelf, watch) as reports:
        settings, mailer = reports._mailer.settings, reports._mailer
        mailer.settings = replace(settings, host="")
        reports.finished(shelf.put("car_20261118T140303Z"))
        await until(lambda: reports._waiting)
        watch.s = 100.0
        await until(lambda: next(iter(reports._waiting.values())).is_refused)
        mailer.settings = settings
        watch.s = 200.0
        await until(lambda: not reports._waiting)
        assert await mailed(reports) == [("car_20261118T140303Z",)]
