"""The list of people and signing on, over HTTP and to pages; what of it survives a restart."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import httpx
import pytest

from server.access import people_files
from server.access.identity import LOCAL, Principal, Role
from server.access.people import People, device_key
from server.app.config import Config
from server.control.duty import HOUR_MS, LONGEST_NAME, MOST_DUTIES, MOST_FORMER, MOST_PEOPLE, DutyEntry, Person
from server.vehicle.vehicle import Vehicle
from server.web.page_sender import PageSender
from tests.http import http_client
from tests.server.access.pairs import keyed, paired_server
from tests.server.conftest import serving
from tests.server.viewer import Viewer, viewer

HOSTILE = ["<script>owned=1</script>", "'; DROP TABLE--", "A\u202eB", "\U0001d56c. \U0001d576.", "{{7*7}}", "名前"]
DATA_FOLDER_FILES = ("people/people.toml", "people/duty.toml")


class Clock:
    def __init__(self) -> None:
        self.ms = 1_800_000_000_000

    def __call__(self) -> int:
        return self.ms


async def add(client: httpx.AsyncClient, name: str, role: str = "operator") -> str:
    answer = await client.post("/api/people", json={"name": name, "role": role})
    assert answer.status_code == 200, answer.text
    return next(str(one["id"]) for one in answer.json()["people"] if one["name"] == name)


async def test_a_paired_device_signs_on_and_its_orders_bear_the_name(tmp_path: Path) -> None:
    async with paired_server(keyed(tmp_path)) as served, served.paired(Role.OPERATOR) as phone:
        ann = await add(phone, "A. K.")
        listed = (await phone.post("/api/duty", json={"person": ann, "role": "supervisor"})).json()
        assert listed["me"]["name"] == "A. K."
        assert (listed["me"]["title"], listed["me"]["device"]) == ("supervisor", "Pixel 7")
        assert [one["role"] for one in listed["roles"]] == ["operator", "safety_driver", "supervisor", "test_engineer"]
        async with served.paired(Role.OPERATOR, "Tablet") as tablet:
            refused = await tablet.post("/api/duty", json={"person": ann})
            assert refused.status_code == 409
            assert refused.json()["detail"] == "A. K. is on duty at Pixel 7: move the duty to this device."
            moved = await tablet.post("/api/duty", json={"person": ann, "moves": True})
            assert moved.json()["me"]["device"] == "Tablet"
            assert (await phone.get("/api/people")).json()["me"] is None
            assert (await tablet.delete(f"/api/people/{ann}")).status_code == 409
            assert (await tablet.delete("/api/duty")).json()["me"] is None
            assert (await tablet.delete(f"/api/people/{ann}")).json()["people"] == []


async def test_who_may_not(tmp_path: Path) -> None:
    async with paired_server(keyed(tmp_path)) as served:
        async with served.paired(Role.VIEWER) as watcher:
            for answer in (await watcher.get("/api/people"), await watcher.post("/api/duty", json={"person": "x"})):
                assert answer.status_code == 403
        async with served.browser(Authorization="Bearer operator-key-of-the-tests") as program:
            person = await add(program, "A. K.")
            refused = await program.post("/api/duty", json={"person": person})
            assert refused.status_code == 409
            assert "Nobody can be on duty at a program" in refused.json()["detail"]


@pytest.mark.parametrize(
    ("body", "status"),
    [
        ({"name": ""}, 422),
        ({"name": "   "}, 409),
        ({"name": "x" * 31}, 409),
        ({"name": "x" * 500}, 422),
        ({"name": "A. K. (Tablet)"}, 409),
        ({"name": "A", "role": "king"}, 422),
        ({"name": 7}, 422),
        ({"name": "A", "more": 1}, 422),
    ],
)
async def test_what_does_not_fit_is_refused(body: dict[str, Any], status: int) -> None:
    async with serving(Config()) as base, http_client(base_url=base) as client:
        answer = await client.post("/api/people", json=body)
        assert answer.status_code == status, answer.text
        assert (await client.get("/api/people")).json()["people"] == []


async def test_pages_of_this_machine_are_told_apart_and_told_at_once(tmp_path: Path) -> None:
    config = Config(data=tmp_path, vehicles=(Vehicle(name="car"),))
    async with serving(config) as base, http_client(base_url=base) as client:
        for name in HOSTILE:
            await add(client, " ".join(name.replace("\u202e", " ").split()))
        person = (await client.get("/api/people")).json()["people"][0]["id"]
        async with (
            viewer(base, name="page-one", page="page-one") as one,
            viewer(base, name="page-two", page="page-two") as two,
        ):
            for page in (one, two):
                await page.until(partial(duties, page))
            assert duty(one)["me"] is None
            assert duty(one)["people"] == len(HOSTILE)
            assert duty(one)["signs"] == "page-one"
            own = {"x-catgraph-page": "page-one"}
            await client.post("/api/duty", json={"person": person, "device": "Phone"}, headers=own)
            await one.until(lambda: duty(one)["me"])
            await two.until(lambda: duty(two)["on_duty"])
            assert duty(two)["me"] is None
            name = duty(one)["me"]["name"]
            assert duty(one)["signs"] == f"{name} (page-one)"
            await one.send({"kind": "present", "visible": True, "sound": "ready", "awake": "ready"})
            assert (await one.ask(kind="control", do="take"))["ok"]
            assert (await client.get("/api/state")).json()["control"]["holder"] == f"{name} (page-one)"
    assert {path for path in DATA_FOLDER_FILES if (tmp_path / path).exists()} == set(DATA_FOLDER_FILES)
    assert tomllib.loads((tmp_path / "people/people.toml").read_text())["people"][0]["changed_ms"] > 0
    async with serving(config) as base, http_client(base_url=base) as client:  # a restart
        found = (await client.get("/api/people", headers={"x-catgraph-page": "page-one"})).json()
        assert found["me"]["name"] == name
        assert (await client.delete("/api/duty", headers=own)).is_success
    kept = tomllib.loads((tmp_path / "people/people.toml").read_text())["people"]
    (off_ms,) = (one["off_ms"] for one in kept if one["name"] == name)
    async with serving(config) as base, http_client(base_url=base) as client:  # and again
        found = (await client.get("/api/people", headers=own)).json()
        assert People(tmp_path, wall_ms=lambda: off_ms).sent(None)["duties"] == {name: off_ms}
        assert len(found["people"]) == len(HOSTILE)


def duties(page: Viewer) -> list[dict[str, Any]]:
    return [message for message in page.other if message["kind"] == "duty"]


def duty(page: Viewer) -> dict[str, Any]:
    return duties(page)[-1]


async def test_without_people_everything_is_as_before(tmp_path: Path) -> None:
    """A data folder of before, and nobody signed on."""
    config = Config(data=tmp_path, vehicles=(Vehicle(name="car"),))
    async with (
        serving(config) as base,
        http_client(base_url=base) as client,
        viewer(base, name="Phone", page="page-one") as page,
    ):
        await page.send({"kind": "present", "visible": True, "sound": "ready", "awake": "ready"})
        assert (await page.ask(kind="control", do="take"))["ok"]
        assert (await client.get("/api/state")).json()["control"]["holder"] == "Phone"
        (event,) = (one for one in (await client.get("/api/events")).json()["events"] if one["change"] == "control")
        assert event["by"] == "Phone"
        assert "person" not in event
    assert not (tmp_path / "people").exists()


async def test_a_duty_ends_by_itself_and_all_pages_are_notified(tmp_path: Path) -> None:
    clock = Clock()
    people = People(tmp_path, wall_ms=clock)
    person = await people.add("A. K.", "operator")
    await people.sign_on("phone", "Pixel 7", person, None, moves=False)
    notified: list[bool] = []
    leave = people.watch(lambda: notified.append(True))
    clock.ms += 13 * HOUR_MS
    again = People(tmp_path, wall_ms=clock)  # it ended while the server was stopped
    again.start()
    assert again.duty_of("phone", "Pixel 7")["me"] is None
    assert "ended by itself after 12 h" in str(again.duty_of("phone", "Pixel 7")["ended"])
    again.stop()
    people._due()
    assert notified == [True]
    leave()
    people.stop()
    assert "ended" in (tmp_path / "people/duty.toml").read_text()


async def test_former_names_and_who_was_removed_survive_a_restart(tmp_path: Path) -> None:
    clock = Clock()
    people = People(tmp_path, wall_ms=clock)
    ann, ben = await people.add("A. K.", "operator"), await people.add("B. K.", "operator")
    await people.change(ann, name="Anna K.", role=None)
    await people.sign_on("phone", "Pixel 7", ann, None, moves=False)
    await people.sign_on("desk", "Desk", ben, None, moves=False)
    await people.sign_off("desk")
    await people.remove(ben)
    again = People(tmp_path, wall_ms=clock)
    assert again.complaint is None
    assert again.sent(None)["duties"] == {"Anna K.": None, "A. K.": None, "B. K.": clock()}


async def test_who_was_removed_is_added_again_by_a_request_that_says_so(tmp_path: Path) -> None:
    async with paired_server(keyed(tmp_path)) as served, served.paired(Role.OPERATOR) as phone:
        ann = await add(phone, "A. K.")
        await phone.post("/api/duty", json={"person": ann})
        await phone.delete("/api/duty")
        await phone.delete(f"/api/people/{ann}")
        refused = await phone.post("/api/people", json={"name": "A. K."})
        assert refused.status_code == 409
        assert "Repeat it if it is the same person." in refused.json()["detail"]
        again = (await phone.post("/api/people", json={"name": "A. K.", "returns": True})).json()["added"]
        stated = People(tmp_path, wall_ms=lambda: 0)  # as after a restart
        assert (stated.board.people[again].was, list(stated.sent(None)["duties"])) == (ann, ["A. K."])


def test_full_lists_of_long_names_are_read_again(tmp_path: Path) -> None:
    clock = Clock()
    people = People(tmp_path, wall_ms=clock)
    board = people.board

    def somebody(number: int, id_letter: str) -> Person:
        names = [(chr(0x20000 + 4 * number + n)) * LONGEST_NAME for n in range(1 + MOST_FORMER)]  # four bytes a letter
        id = id_letter * 50 + str(number)
        return Person(
            id=id,
            name=names[0],
            role="safety_driver",
            last_ms=clock() - 1,
            off_ms=clock(),
            former=tuple(names[1:]),
            changed_ms=clock(),
            was=id[::-1],
        )

    for number in range(3 * MOST_PEOPLE):
        one = somebody(number, "g")
        board.people[one.id] = one
        board.forget(one.id, clock())
    for number in range(MOST_PEOPLE):
        one = somebody(1000 + number, "p")
        board.people[one.id] = one
    for number in range(2 * MOST_DUTIES):
        entry = DutyEntry(
            device=f"{number:060}", device_name="\U00020000" * 40, changed_ms=clock(), ended="\U00020000" * 200
        )
        if number < MOST_PEOPLE:
            on_duty = list(board.people)[number]
            entry = replace(entry, person=on_duty, role="safety_driver", since_ms=clock(), ended=None)
        board.entries[entry.device] = entry
    board.advance(clock())
    people.keep_soon()
    again = People(tmp_path, wall_ms=clock)
    assert again.complaint is None
    for kept in ("people", "gone", "removed", "entries"):
        assert getattr(again.board, kept) == getattr(board, kept)
    assert len(board.gone) == MOST_PEOPLE


def test_a_removed_person_that_cannot_be_read_costs_only_itself(tmp_path: Path) -> None:
    path = tmp_path / "people/people.toml"
    path.parent.mkdir()
    rows = ['name = "B."', 'id = "b"', 'id = "../b"\nname = "B."', 'id = "b"\nname = "..."', 'id = "good"\nname = "G."']
    path.write_text("\n".join(['[[people]]\nid = "a"\nname = "A. K."', *(f"[[gone]]\n{row}" for row in rows)]))
    found = People(tmp_path, wall_ms=Clock())
    assert found.complaint is None
    assert (list(found.board.people), list(found.board.gone)) == (["a"], ["good"])


@pytest.mark.parametrize("name", ["people.toml", "duty.toml"])
@pytest.mark.parametrize(
    "content",
    [
        "",
        "\x00",
        "people = 7",
        "[[people]]\nname = 1",
        '[[duties]]\ndevice = "../x"',
        "ends_after_h = 900",
        "a" * 70000,
    ],
)
def test_a_file_that_cannot_be_used_is_set_aside(tmp_path: Path, name: str, content: str) -> None:
    folder = tmp_path / "people"
    folder.mkdir()
    (folder / name).write_text(content)
    found = People(tmp_path, wall_ms=Clock())
    assert found.board.people == {}
    assert found.board.entries == {}
    if found.complaint is not None:
        assert [path.read_text() for path in folder.glob("*unusable*")] == [content]


async def test_a_file_that_cannot_be_read_is_never_overwritten(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept = tmp_path / "people/people.toml"
    kept.mkdir(parents=True)  # not a file: it cannot be read, by nobody
    people = People(tmp_path, wall_ms=Clock())
    assert people.complaint is not None
    assert (kept.parent / "people.unusable.toml").is_dir()
    await people.add("A. K.", "operator")
    assert kept.is_file()

    def cannot(path: Path) -> Path:
        raise OSError(30, "read-only")

    kept.write_text("people = 7")
    monkeypatch.setattr(people_files, "set_aside", cannot)
    people = People(tmp_path, wall_ms=Clock())
    with pytest.raises(OSError, match="not overwritten"):
        await people.add("B. K.", "operator")
    people.keep_soon()
    assert kept.read_text() == "people = 7"


@pytest.mark.parametrize(
    ("kind", "device", "ago_s", "ends"),
    [
        ("accept_control", "phone", None, True),
        ("outcome", "phone", 5.0, True),
        ("outcome", "phone", 15.0, False),  # they signed on again since then
        ("control", "phone", None, False),
        ("accept_control", "tablet", None, False),  # another tab of the device that takes over
    ],
)
async def test_a_hand_over_ends_the_duty_at_the_other_device(
    kind: str, device: str, ago_s: float | None, ends: bool
) -> None:
    clock = Clock()
    people = People(None, wall_ms=clock)
    await people.sign_on(device, "Pixel 7", await people.add("A. K.", "operator"), None, moves=False)
    clock.ms += 10_000
    tablet = PageSender(Principal(id="tablet", name="Tablet", role=Role.OPERATOR), people)
    over: dict[str, Any] = {"device": device, "to": "Ben"} | ({} if ago_s is None else {"ago_s": ago_s})
    assert await tablet.end_handed_over(kind, {"ok": True, "handed_over": over}) == {"ok": True}
    assert (people.board.on_duty(device) is None) is ends


async def test_adding_a_person_answers_their_id(tmp_path: Path) -> None:
    async with serving(Config()) as base, http_client(base_url=base) as client:
        for name in ("B.", "A."):
            answer = (await client.post("/api/people", json={"name": name})).json()
            assert next(one["name"] for one in answer["people"] if one["id"] == answer["added"]) == name


def test_a_program_has_no_device() -> None:
    device = Principal(id="d1", name="Pixel", role=Role.OPERATOR)
    program = Principal(id="key-operator", name="key", role=Role.OPERATOR, is_program=True)
    assert device_key(device, "page-a") == device_key(device, None) == "d1"
    assert device_key(program, "page-a") is None
    assert (device_key(LOCAL, "page-a"), device_key(LOCAL, None)) == ("page-page-a", None)
