"""A whole day: sign on, departure check, a drive with marks, an intervention, a kill -9, a hand-over; then its report.

Every moment is compared with what truly was: the browser's own clock for what fingers did, the simulator's for the car.
"""

from __future__ import annotations

import asyncio
import io
import json
import re
import time
import zipfile
from collections.abc import AsyncIterator, Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import mcap.reader
import pytest
import pytest_asyncio
from playwright.async_api import Browser, Locator, async_playwright, expect

from server.mail.drive_reports import FILE, QUIET_S
from tests.chromium import FLAGS
from tests.page.conftest import LOST, Phone
from tests.page.day import REPORT_TO, Day, a_day, held, read_back, tapped_through
from tests.page.test_marks import picture

WITHIN_S = 0.2
READER = Path(__file__).with_name("mcap_attachments.mjs")
MARKS = ("tap", "voice", "words", "without server")  # in the order of their moments
TEXT = "The box stood behind the corner."


@pytest_asyncio.fixture(loop_scope="session", scope="module")
async def equipped(chromium: str) -> AsyncIterator[Browser]:
    """A browser with a fake microphone and camera."""
    async with async_playwright() as playwright:
        flags = [*FLAGS, "--use-fake-device-for-media-stream", "--use-fake-ui-for-media-stream"]
        browser = await playwright.chromium.launch(executable_path=chromium, args=flags)
        yield browser
        await browser.close()


@pytest.mark.slow
@pytest.mark.timeout(360)
async def test_the_report_holds_the_whole_day_at_the_right_second(
    equipped: Browser, tmp_path: Path, record_property: Callable[[str, object], None]
) -> None:
    async with a_day(equipped, tmp_path) as day:
        await signed_on(day)
        await departed(day)
        await taken_over(day)
        await marked(day)
        await marked_without_server(day)
        await described(day)
        await handed_over(day)
        parts = await ended(day)
        ended_s = time.monotonic()
        off_s = in_report(day, parts, await day.json(f"/api/recordings/{parts[1]}/export/report_json"))
        for what, seconds in off_s.items():
            record_property(f"{what} [s]", round(seconds, 3))
        print(off_s, day.taps)
        late_s = 3 * day.ann.stutter_s  # what a server logs when it receives it, on a machine that lets it wait
        exact = (*MARKS, "intervention")
        too_far = {
            what for what, seconds in off_s.items() if abs(seconds) > WITHIN_S + (0 if what in exact else late_s)
        }
        assert too_far == set(), off_s
        files = [(await day.get(f"/api/recordings/{id}/file.mcap")).content for id in parts]
        await listed_by_readers(day, files, tmp_path)
        await on_paper(equipped, day, parts)
        await replayed(day, parts)
        mailed_s = await mailed(day, parts) - ended_s
        record_property("mail seen after the end [s]", round(mailed_s, 1))
        print(f"mailed {mailed_s:.1f} s after the end")
        complaints = [line for phone in day.phones for line in phone.complaints if not LOST.search(line)]
        assert complaints == []


async def signed_on(day: Day) -> None:
    for phone, name in ((day.ann, "A. K."), (day.ben, "M. R.")):
        sheet = phone.page.locator("#sheet-duty")
        person = sheet.locator("[data-person]").filter(has=phone.page.get_by_text(name, exact=True))
        await day.press(phone, person, f"{name} on duty")
        await day.press(phone, sheet.locator('[data-f="sign-on"]'), f"{name} on duty")
        await expect(sheet).to_have_count(0)
        assert day.taps[f"{name} on duty"] == 2


async def departed(day: Day) -> None:
    """The GPS has no fix, is mended, and the check is signed."""
    page = day.ann.page
    screen = page.locator(".departure")

    async def face(item: str, wanted: str) -> None:
        await expect(screen.locator(f'[data-item="{item}"]')).to_have_attribute("data-face", wanted, timeout=20_000)

    await day.car.type("no-fix 600")
    await tapped_through(day.ann, day.ann.f("menu"))
    await page.get_by_role("button", name="Departure check").tap()
    await screen.get_by_role("button", name="Begin the check").tap()
    await face("gps", "failed")
    await face("recorder", "done")
    await day.car.type("stop no-fix")
    await face("gps", "done")
    for item in ("tyres", "belt"):
        await expect(screen.locator(".dep-list[data-moved]")).to_have_count(0)
        await tapped_through(day.ann, screen.locator(f'[data-item="{item}"]').get_by_role("button", name="Done:"))
        await face(item, "done")
    await expect(screen.locator(".dep-list[data-moved]")).to_have_count(0)
    await day.press(day.ann, screen.get_by_role("button", name="Sign as A. K."), "departure")
    await expect(screen.locator(".dep-seal")).to_contain_text("Ready: signed by A. K.")
    await day.ann.f("back").tap()


def mark_key(phone: Phone) -> Locator:
    return phone.page.locator('[data-f="mark"]')


async def marked(day: Day) -> None:
    """By a tap, by voice with a photo, with text."""
    phone, page = day.ann, day.ann.page
    await tapped_through(phone, mark_key(phone))
    day.truth_ms["tap"] = await page.evaluate("presses.at(-1)")
    await day.marks(1)
    day.truth_ms["voice"] = await held(phone, mark_key(phone), 1.6)
    await day.marks(2, voice=True)
    async with page.expect_file_chooser() as chosen:
        await page.locator('[data-f="mark-photo"]').tap()
    await (await chosen.value).set_files({"name": "a.png", "mimeType": "image/png", "buffer": picture()})
    await day.marks(2, voice=True, photo=True)
    await day.press(phone, mark_key(phone), "words")
    await page.locator('[data-f="mark-words"]').tap()
    sheet = page.locator("#sheet-mark")
    await sheet.get_by_role("button", name="Control").tap()
    await sheet.locator("textarea").fill(TEXT)
    await sheet.get_by_role("button", name="Keep").tap()
    await day.marks(3, category="control", words=TEXT)


async def taken_over(day: Day) -> None:
    """The safety driver takes over, and nobody has time to say why."""
    await day.car.type("manual-takeover 4")
    await day.until("/api/state", lambda state: len(state["mode"]["open"]) == 1)
    (true,) = await day.interventions()
    day.truth_ms["intervention"] = true["at_ms"]


async def described(day: Day) -> None:
    """The operator enters why the driver took over, in the next part of the drive: the server was killed meanwhile."""
    page = day.ann.page
    sheet = page.locator("#sheet-take-over")
    await tapped_through(day.ann, day.ann.f("mode-key"))
    await sheet.locator('[data-f="what"]').fill(TEXT)
    await tapped_through(day.ann, sheet.locator('[data-category="object_late"]'))
    await tapped_through(day.ann, sheet.locator('[data-f="keep"]'))
    await expect(sheet).to_have_count(0)


async def marked_without_server(day: Day) -> None:
    """The server is killed; what is marked meanwhile is delivered when it is back."""
    key = mark_key(day.ann)
    await day.watch.kill()
    await expect(key).to_contain_text("stored on this device", timeout=15_000)
    await tapped_through(day.ann, key)
    day.truth_ms["without server"] = await day.ann.page.evaluate("presses.at(-1)")
    await expect(day.ann.page.locator('[data-f="marks-wait"]')).to_have_text(
        re.compile(r"^(1 waits|2 wait)$")  # the answer to the one before may have been on its way
    )
    await day.serve()
    for phone in day.phones:
        await phone.live()
    await day.marks(4)
    await day.until("/api/state", lambda state: state["recording"]["state"] == "recording")


async def handed_over(day: Day) -> None:
    ann, ben = day.ann, day.ben
    await tapped_through(ann, ann.f("who"))
    await ann.page.locator('#sheet-cars [data-f="cars-control"]').tap()
    await day.press(
        ann, ann.page.locator("#sheet-control").get_by_role("button", name="Take control"), "A. K. in control"
    )
    await expect(ann.f("who-name")).to_have_text("AK controls")
    await tapped_through(ann, ann.f("who"))
    await ann.page.locator('#sheet-cars [data-f="cars-control"]').tap()
    await ann.page.locator("#sheet-control").get_by_role("button", name="Hand over to M. R. (iPhone)").tap()
    sheet = ben.page.locator("#sheet-handover")
    await read_back(sheet)
    await day.press(ben, sheet.locator('[data-f="take-over"]'), "M. R. in control")
    await expect(ben.f("who-name")).to_have_text("MR controls")


async def ended(day: Day) -> list[str]:
    """Ben ends the recording; answers the parts of the drive, oldest first."""
    await tapped_through(day.ben, day.ben.f("menu"))
    await day.ben.page.locator('#sheet-menu [data-f="record"]').tap()
    await day.ben.page.get_by_role("button", name="End the recording").tap()  # the car moves

    def are_read(found: Any) -> bool:
        rows = found["recordings"]
        return len(rows) == 2 and all(row["state"] == "read" for row in rows)

    rows = (await day.until("/api/recordings", are_read))["recordings"]
    return sorted(row["id"] for row in rows)


def in_report(day: Day, parts: list[str], report: dict[str, Any]) -> dict[str, float]:
    """By how much each moment of the day is off in the report of the drive [s]; everything is there, and once."""
    assert [part["recording"] for part in report["parts"]] == parts
    assert len(report["gaps"]) == 1, "while the server was killed"
    marks = report["marks"]
    assert len(marks) == len({mark["mark"] for mark in marks}) == 4
    found = dict(zip(MARKS, (mark["marked_ms"] for mark in marks), strict=True))
    assert [(mark["voice"], mark["photo"]) for mark in marks] == [(False, False), (True, True), *2 * [(False, False)]]
    assert [mark["words"] for mark in marks] == ["", "", TEXT, ""]
    (one,) = report["interventions"]
    assert (one["kind_of"], one["initiated_by"], one["what"]) == ("to_manual", "driver", TEXT)
    assert one["described_by"].startswith("A. K.")
    found["intervention"] = one["at_ms"]
    departure = report["departure"]
    assert (departure["state"], departure["done"], departure["failed"]) == ("signed", 4, 0)
    assert [part["state"] for part in report["chain"]] == ["intact", "intact"]
    fixed = {item["item"]: item["result"] for item in departure["items"] if item["had_failed"]}
    assert fixed == {"gps": "done"}
    found["departure"] = departure["at_ms"]
    for person in report["people"]:
        for act in ("on_duty", "in_control"):
            if person[act]:
                found[f"{person['name']} {act.replace('_', ' ')}"] = person[act][0]["from_ms"]
    return {what: (found[what] - true_ms) / 1000 for what, true_ms in day.truth_ms.items()}


async def listed_by_readers(day: Day, files: list[bytes], folder: Path) -> None:
    """Voice and photo are attachments of the recording, for readers that know nothing of catgraph."""
    first = mcap.reader.make_reader(io.BytesIO(files[0]))
    attachments = {one.media_type: one for one in first.iter_attachments()}
    assert sorted(attachments) == ["audio/webm", "image/jpeg"]
    assert attachments["audio/webm"].data.startswith(b"\x1a\x45\xdf\xa3")
    path = folder / "first.mcap"
    path.write_bytes(files[0])
    node = await asyncio.create_subprocess_exec("node", str(READER), str(path), stdout=asyncio.subprocess.PIPE)
    out, _ = await asyncio.wait_for(node.communicate(), 30)
    assert node.returncode == 0
    info = json.loads(out)
    assert info["schemas"]["/catgraph/marks"] == "foxglove.Log"
    assert {one["mediaType"]: (one["name"], one["bytes"]) for one in info["attachments"]} == {
        kind: (one.name, len(one.data)) for kind, one in attachments.items()
    }
    for one in info["attachments"]:
        assert abs(one["log_ms"] - day.truth_ms["voice"]) < 1000 * WITHIN_S


async def on_paper(browser: Browser, day: Day, parts: list[str]) -> None:
    """The page of the report shows the same: each thing at its second, voice and photo included."""
    page = await browser.new_page()
    await page.goto(f"{day.watch.address}/api/recordings/{parts[1]}/report", timeout=60_000)
    report = page.locator("article.drive")
    await expect(report).to_contain_text("A. K. (Pixel 7)")
    await expect(report.get_by_text("in control")).to_have_count(2)
    await expect(report.locator("section.parts tbody tr")).to_have_count(3)
    marks = await report.locator("section.marks tbody td.n").all_inner_texts()
    assert await report.locator("section.marks audio").count() == 1
    photo = report.locator("section.marks img")
    assert await photo.evaluate("(photo) => photo.naturalWidth") > 0
    taken_over = report.locator("section.interventions tbody tr")
    await expect(taken_over).to_contain_text(TEXT)
    assert (await taken_over.locator("td.n").inner_text()) in seconds_of(day.truth_ms["intervention"])
    await expect(report).to_contain_text("had failed, fixed")
    true = [day.truth_ms[what] for what in MARKS]
    assert [shown in seconds_of(at_ms) for shown, at_ms in zip(marks, true, strict=True)] == [True] * 4
    await page.close()


def seconds_of(true_ms: float) -> set[str]:
    """The seconds that may be shown for a moment."""
    near = (true_ms / 1000 - WITHIN_S, true_ms / 1000, true_ms / 1000 + WITHIN_S)
    return {datetime.fromtimestamp(at_s, UTC).strftime("%H:%M:%S") for at_s in near}


async def replayed(day: Day, parts: list[str]) -> None:
    """A replay has a flag for each mark, and at its moment its text, with its voice and its photo."""
    marks = (await day.json(f"/api/recordings/{parts[0]}/marks"))["marks"]
    phone = day.ben
    card = phone.page.locator(".mark-card")
    for what in ("voice", "words"):
        at_s = marks[MARKS.index(what)]["at_s"]
        await phone.page.goto(f"{day.watch.address}/?replay={parts[0]}&t={at_s + 0.3:.1f}#home")
        await phone.page.wait_for_selector('html[data-replay="on"]', state="attached", timeout=40_000)
        await expect(phone.page.locator(".scrub .marks .flag")).to_have_count(len(marks))
        await expect(card).to_be_visible()
        if what == "words":
            await expect(card).to_contain_text(TEXT)
        else:
            await expect(card.locator(".card-parts img")).to_be_visible()
            assert (await day.get(f"/api/recordings/{parts[0]}/marks/{marks[1]['mark']}/voice")).content


async def mailed(day: Day, parts: list[str]) -> float:
    """The report is mailed once the drive has ended, and not again after a restart; answers when it came [s]."""

    def is_sent(found: Any) -> bool:
        return [mail["state"] for mail in found["mails"]] == ["sent"]

    await day.until("/api/mail", is_sent, QUIET_S + 40)
    came_s = time.monotonic()
    has_the_day(day, parts)
    assert json.loads((day.data / "mail" / FILE).read_bytes()) == {}, "nothing is left to be mailed"
    await day.watch.terminate()
    await day.serve()
    await day.until("/api/state", lambda state: state["recording"]["state"] == "recording")
    assert is_sent(await day.json("/api/mail")), "none was ordered, and none waits"
    assert len(mailed_pages(day)) == 1
    return came_s


def has_the_day(day: Day, parts: list[str]) -> None:
    """What was mailed is one page, of the whole drive."""
    ((name, page),) = mailed_pages(day)
    assert name == f"{parts[0]}.html"
    assert all(part in page for part in parts)
    assert "audio/webm;base64," in page
    assert TEXT in page


def mailed_pages(day: Day) -> list[tuple[str, str]]:
    """Name and content of each report that was mailed until now."""
    pages: list[tuple[str, str]] = []
    for mail in day.post.mails():
        assert [one.addr_spec for one in mail["To"].addresses] == [REPORT_TO]
        for part in mail.iter_attachments():
            with zipfile.ZipFile(io.BytesIO(part.get_content())) as packed:
                pages += [(name, packed.read(name).decode()) for name in packed.namelist()]
    return pages
