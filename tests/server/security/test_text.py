"""Text from car, phone, page or file is clean in the alarm log; a page's message has only what a page may send."""

from __future__ import annotations

import csv
import io
import json

import pytest

from server.app.config import Config
from server.bus.event_table import safe_cell
from server.protocol import commands, messages
from server.rosbridge_server.server import RosBridge
from server.system.clean_text import clean, cleaned
from server.vehicle.vehicle import Vehicle
from tests.http import http_client
from tests.server.cars import driving
from tests.server.conftest import serving
from tests.server.viewer import viewer

pytestmark = pytest.mark.world(n=24)

HOSTILE = (
    "motor\x1b[2J\x1b]0;gone\x07\x00\x08"
    "\u202eeman\u202c\u2066x\u2069\u200b\u200d\ufeff\u2028line\u2029page\x85next\r\n"
    '2026-01-01,"raised",obstacle,forged\x9b31m\U000e0041\udc80'
)


UNSEEN = [
    *map(chr, range(0x20)),
    *map(chr, range(0x7F, 0xA0)),
    *"\u00ad\u061c\u200b\u200e\u200f\u2028\u2029\u202a\u202e\u2060\u2066\u2069\ufeff",
    "\ud800",
    "\U000e0001",
]


@pytest.mark.parametrize("sign", UNSEEN)
def test_no_sign_that_is_not_seen_stays(sign: str) -> None:
    assert clean(f"a{sign}b") in ("ab", "a b")


def test_what_people_write_stays() -> None:
    for text in ("", "Speed 7 m/s", "vitesse élevée", "速度", "×−–’σ", "naïve 🚗", "عربي"):
        assert clean(text) == text
    assert clean("a\tb\nc\u00a0d") == "a b c d"
    assert clean("x" * 50, 10) == "x" * 9 + "…"
    assert cleaned({"a\x00": ["b\x1b", 1, None, {"c": "\u202e"}]}) == {"a ": ["b ", 1, None, {"c": ""}]}


@pytest.mark.parametrize("text", ["=1+1", " =1+1", "\t=1", "+1", "-1", "@x", "\uff1d1", "\u200b=1", "|x", "\n=1+1"])
def test_no_cell_is_a_formula(text: str) -> None:
    assert safe_cell(text).startswith("'")
    assert safe_cell(-1.5) == -1.5


async def test_the_alarm_log_is_clean_whatever_the_car_and_a_page_say(bridge: RosBridge) -> None:
    bridge.advertise("/diagnostics", "diagnostic_msgs/DiagnosticArray")
    config = Config(vehicles=(Vehicle(name="car", address=bridge.address),))  # type: ignore[attr-defined]
    async with (
        serving(config) as base,
        viewer(base, name="Ann\u202e=1\x1b") as one,
        driving(bridge, speed=lambda n: 3.0),
    ):
        await one.until(lambda: one.states and one.states[-1]["session"]["phase"] == "monitoring", within_s=20.0)
        values = [{"key": HOSTILE.replace("\udc80", ""), "value": HOSTILE.replace("\udc80", "")}]
        status = {
            "level": 2,
            "name": HOSTILE.replace("\udc80", ""),
            "message": values[0]["key"],
            "hardware_id": "",
            "values": values,
        }
        header = {"seq": 0, "stamp": {"secs": 1, "nsecs": 0}, "frame_id": "\x1b"}
        for _ in range(40):
            bridge.publish("/diagnostics", {"header": header, "status": [status]})
            if any("motor" in json.dumps(event) for event in one.events):
                break
            seen = len(one.states)
            await one.until(lambda seen=seen: len(one.states) > seen, within_s=20.0)  # type: ignore[misc]
        assert any("motor" in json.dumps(event) for event in one.events), "the car's diagnostics are an alarm"
        await one.ask(kind="pause")
        async with http_client(base_url=base) as client:
            before = (await client.get("/api/log.json")).json()
            rows = (await client.get("/api/log.csv")).text
            log = (await client.get("/api/log.json")).json()
    for text in (
        rows.replace("\r\n", ""),
        *(value for event in log for value in event.values() if isinstance(value, str)),
    ):
        assert text.isprintable(), repr(text)
    table = list(csv.reader(io.StringIO(rows)))
    assert {len(row) for row in table} == {len(table[0])}
    numbers = [int(row[0]) for row in table[1:]]
    assert numbers == [event["n"] for event in log][: len(numbers)], "no line is forged"
    assert len(numbers) >= len(before), "no line is missing; the log goes on growing while it is read"


# -- what a page may say ---


def test_the_kinds_of_a_page_are_a_table() -> None:
    assert commands.KINDS == {
        "acknowledge", "arm", "connect", "control", "disarm", "disconnect", "import", "pause", "position",
        "present", "record", "release", "resume", "retry", "ride", "set", "shelve", "silence", "slow_down", "unshelve",
        "veto",
    } | {"answer_item", "offer_item", "release_item", "take_item", "withdraw_item"} | {
        "accept_control", "end_offer", "offer_control", "outcome", "read_back", "mark", "remove_mark",
        "describe_intervention", "take_alarm", "planned_stop", "end_planned_stop",
    } | {
        "begin_departure", "reopen_departure", "set_departure_item", "set_departure_list", "sign_departure",
    }  # fmt: skip


@pytest.mark.parametrize(
    "kind",
    [
        "state",
        "refresh",
        "signals",
        "settings",
        "trends",
        "track",
        "track_points",
        "driving",
        "",
        "x",
        3,
        None,
        ["state"],
    ],
)
async def test_what_the_server_asks_of_a_session_is_refused_to_a_page(kind: object) -> None:
    async with serving(Config()) as base, viewer(base) as one:
        await one.until(lambda: one.states)
        answer = await one.ask(kind=kind)
        assert answer == {"kind": "reply", "id": answer["id"], "ok": False, "reason": "Unknown command."}


def test_no_key_of_an_answer_replaces_one_of_the_envelope() -> None:
    answer = {"kind": "state", "id": "8", "ok": True, "version": 3}
    assert messages.reply("7", answer) == {"kind": "reply", "id": "7", "ok": True, "version": 3}
    assert messages.reply("7", {"ok": "yes"})["ok"] is False, "only True is an agreement"
