"""The departure check: what turns by itself, what is seen, what a person enters, and the signature; in virtual time."""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import replace
from typing import Any

import pytest

from monitor.runner import Refused
from server.control import departure_list
from server.control.departure import FAILED_AFTER_S, MOST_TURNS, Change, DepartureCheck, Result
from server.control.departure_list import KINDS, MOST_ITEMS, USUAL, Item, from_toml, of_rows, to_toml
from server.control.departure_sight import Seen
from server.judge import profiles
from server.protocol.departure import DepartureKind

READY = Seen(
    is_monitored=True,
    checks={"gps_fix": ("ok", "8 satellites"), "obstacle": ("fault", "2.1 m ahead"), "laser": ("unknown", "no scan")},
    rates_hz={"/catvehicle/vel": 20.0},
    is_recording=True,
    phones=2,
    room_gb=41.0,
    ahead_s=-0.02,
    brake_percent=0.0,
    accelerator_percent=0.0,
    tyre_rad=0.0,
    speed_mps=0.0,
    slow_down="not_armed",
)
WALL_MS = 1_800_000_000_000


class Walk:
    """A check that is begun, of one item of each given kind; time goes on by `see`."""

    def __init__(self, *items: Item) -> None:
        self.check = DepartureCheck(items)
        self.check.begin("c1", "Ann", WALL_MS)
        self.now_s = 0.0
        self.changes: list[Change] = []

    def see(self, seen: Seen, for_s: float = 0.0) -> None:
        until_s = self.now_s + for_s
        while True:
            self.changes += self.check.look(seen, self.now_s, WALL_MS + round(self.now_s * 1000))
            if self.now_s >= until_s:
                return
            self.now_s = round(self.now_s + 0.05, 3)

    def result(self, item: Item) -> tuple[str, str]:
        found = self.check.result(item)
        return found.result, found.value

    def say(self, item: Item, result: Any, note: str = "") -> None:
        self.check.set_item(item.id, result, note, "Ann", WALL_MS)


def item(kind: DepartureKind = "manual", of: str = "", need: float | None = None) -> Item:
    return Item(id=kind, title=kind, kind=kind, of=of, need=KINDS[kind].need if need is None else need)


@pytest.mark.parametrize(
    ("one", "seen", "result"),
    [
        (item("check", "gps_fix"), READY, ("done", "OK")),
        (item("check", "obstacle"), READY, ("failed", "2.1 m ahead")),
        (item("check", "laser"), READY, ("open", "not checked: no scan")),
        (item("check", "other"), READY, ("open", "there is no such check")),
        (item("check", "gps_fix"), replace(READY, is_monitored=False), ("open", "no car is monitored")),
        (item("topic", "/catVehicle/vel"), READY, ("done", "20.0 Hz")),
        (item("topic", "/catvehicle/vel", 30.0), READY, ("failed", "20.0 Hz")),
        (item("topic", "/brake"), READY, ("failed", "no message")),
        (item("recorder"), READY, ("done", "records")),
        (item("recorder"), replace(READY, is_recording=False, recorder="Full disk."), ("failed", "Full disk.")),
        (item("sound"), READY, ("done", "on 2 phones")),
        (item("sound"), replace(READY, phones=0), ("failed", "on no phone")),
        (item("sound", need=3.0), READY, ("failed", "on 2 phones")),
        (item("disk"), READY, ("done", "41 GB free")),
        (item("disk"), replace(READY, room_gb=1.25), ("failed", "1.2 GB free")),
        (item("disk"), replace(READY, room_gb=None), ("open", "known once it records")),
        (item("clock"), READY, ("done", "differs 0.02 s")),
        (item("clock"), replace(READY, ahead_s=-0.84), ("failed", "differs 0.84 s")),
        (item("clock"), replace(READY, ahead_s=None), ("open", "the car does not send its time")),
    ],
    ids=lambda value: value.kind if isinstance(value, Item) else value[1] if isinstance(value, tuple) else "",
)  # fmt: skip
def test_automatic_items_turn_by_what_is_known(one: Item, seen: Seen, result: tuple[str, str]) -> None:
    walk = Walk(one)
    walk.see(seen, FAILED_AFTER_S)
    assert walk.result(one) == result


def test_a_failed_item_that_is_fixed_turns_by_itself_and_is_marked_as_fixed() -> None:
    recorder = item("recorder")
    walk = Walk(recorder)
    walk.see(replace(READY, is_recording=False), 1.9)
    assert walk.result(recorder)[0] == "open", "what begins is given a moment"
    walk.see(replace(READY, is_recording=False), 0.2)
    walk.see(READY, 0.9)
    assert walk.result(recorder)[0] == "failed"
    walk.see(READY, 0.2)
    assert walk.result(recorder) == ("done", "records")
    assert walk.check.result(recorder).is_fixed
    walk.see(replace(READY, is_recording=False), 1.9)
    assert walk.result(recorder)[0] == "done", "a moment without a message is no failure"
    walk.see(replace(READY, is_recording=False), 0.2)
    assert walk.result(recorder)[0] == "failed"
    assert [change.result.result for change in walk.changes] == ["failed", "done", "failed"]


def test_one_that_flaps_does_not_fill_the_log_and_what_is_signed_is_in_it() -> None:
    sound = item("sound")
    walk = Walk(sound)
    for _ in range(MOST_TURNS):
        walk.see(replace(READY, phones=0), 2.1)
        walk.see(READY, 1.1)
    assert len(walk.changes) == MOST_TURNS
    changes = walk.check.sign("c1", "Ann", "", WALL_MS)
    assert [(change.step, change.result.result) for change in changes] == [("item", "done"), ("signed", "open")]


@pytest.mark.parametrize("kind", ["brake", "accelerator"])
def test_a_pedal_passes_as_soon_as_it_was_pressed_far_enough_and_holds_its_peak(kind: DepartureKind) -> None:
    pedal = item(kind, need=20.0)
    walk = Walk(pedal)
    for percent in (0.0, 14.0, 16.0, 3.0, None, 19.9):
        walk.see(replace(READY, **{f"{kind}_percent": percent}))
    assert walk.result(pedal)[0] == "open"
    assert walk.check.peaks[pedal.id].highest == 19.9
    assert walk.check.peaks[pedal.id].now == 19.9
    walk.see(replace(READY, **{f"{kind}_percent": 34.0}))
    walk.see(READY)
    assert walk.result(pedal) == ("done", "34 %")


def test_what_a_person_marks_as_failed_stays_until_it_is_taken_back_and_done_again() -> None:
    pedal = item("brake", need=20.0)
    walk = Walk(pedal)
    pressed = replace(READY, brake_percent=34.0)
    walk.see(pressed)
    walk.say(pedal, "failed", "spongy")
    walk.see(READY, 1.0)
    walk.see(pressed)
    assert walk.check.result(pedal).note == "spongy"
    walk.say(pedal, "open")
    walk.see(READY, 1.0)
    assert walk.result(pedal)[0] == "open", "what was seen before does not count"
    walk.see(pressed)
    assert walk.result(pedal) == ("done", "34 %")
    assert walk.check.result(pedal).is_fixed


def test_steering_passes_left_then_right_and_not_the_other_way_round() -> None:
    steering = item("steering", need=5.0)
    walk = Walk(steering)
    for degrees in (-6.0, 4.0, -6.0, 6.0, -4.9, None):
        walk.see(replace(READY, tyre_rad=None if degrees is None else math.radians(degrees)))
    assert walk.result(steering)[0] == "open"
    walk.see(replace(READY, tyre_rad=math.radians(-5.5)))
    assert walk.result(steering) == ("done", "6.0° left, 5.5° right")


def test_the_slow_down_is_proven_at_standstill_without_a_break() -> None:
    slow = item("slow_down", need=2.0)
    walk = Walk(slow)
    held = replace(READY, slow_down="holding")
    walk.see(replace(READY, slow_down="armed"), 3.0)
    walk.see(held, 1.5)
    walk.see(replace(held, speed_mps=0.3))
    walk.see(held, 1.9)
    assert walk.result(slow)[0] == "open"
    walk.see(replace(held, speed_mps=None), 3.0)
    assert walk.result(slow)[0] == "open", "a speed that is not known is no standstill"
    walk.see(held, 2.0)
    assert walk.result(slow) == ("done", "0 m/s held 2 s")


def test_what_people_say_and_what_they_may_not() -> None:
    doors, brake, sound = item(), item("brake"), item("sound")
    walk = Walk(doors, brake, sound)
    refusals = [
        (doors, "failed", "", "Say why"),
        (doors, "not_applicable", " \u202e ", "Say why"),
        (brake, "done", "", "not ticked by hand: do it, and it is seen"),
        (sound, "done", "", "not ticked by hand: it turns by itself"),
        (sound, "failed", "broken", "turns by itself"),
        (Item(id="gone", title="Gone"), "done", "", "not in the departure check any more"),
    ]
    for one, result, note, why in refusals:
        with pytest.raises(Refused, match=why):
            walk.say(one, result, note)
    walk.say(doors, "failed", "left lamp\x1b[2J is dark")
    assert walk.check.result(doors).note == "left lamp [2J is dark"
    walk.say(doors, "done")
    assert walk.check.result(doors).is_fixed
    walk.say(sound, "not_applicable", "Not fitted to this car")
    walk.see(READY, 3.0)
    assert walk.result(sound)[0] == "not_applicable", "it turns no longer"
    walk.say(sound, "open")
    walk.see(READY, 3.0)
    assert walk.result(sound) == ("done", "on 2 phones")


def test_it_is_signed_only_when_nothing_is_failed_or_open() -> None:
    doors, sound, brake = item(), item("sound"), item("brake")
    walk = Walk(doors, sound, brake)
    walk.see(replace(READY, phones=0), 2.0)
    with pytest.raises(Refused, match="Not ready: 1 failed, 2 open"):
        walk.check.sign("c1", "Ann", "", WALL_MS)
    walk.say(doors, "done")
    walk.say(brake, "not_applicable", "Not needed for this drive")
    walk.see(READY, 2.0)
    with pytest.raises(Refused, match="begun again"):
        walk.check.sign("c0", "Ann", "", WALL_MS)
    assert [change.step for change in walk.check.sign("c1", "A. K. (Pixel 7)", "operator", WALL_MS)] == ["signed"]
    signed = walk.check.signature
    assert signed is not None
    assert (signed.by, signed.role, signed.at_ms, signed.fixed) == ("A. K. (Pixel 7)", "operator", WALL_MS, 1)
    assert signed.counts == {"done": 2, "failed": 0, "not_applicable": 1, "of": 3}
    assert hashlib.sha256(signed.document.encode()).hexdigest() == signed.hash
    body = json.loads(signed.document)
    assert json.dumps(body, sort_keys=True, separators=(",", ":"), ensure_ascii=False) == signed.document
    assert [row["result"] for row in body["items"]] == ["done", "done", "not_applicable"]
    with pytest.raises(Refused, match="reopen it first"):
        walk.say(doors, "open")
    walk.see(replace(READY, phones=0), 5.0)
    assert walk.result(sound)[0] == "done", "what was signed stays"
    assert walk.check.reopen().step == "reopened"
    walk.see(replace(READY, phones=0), 2.5)
    with pytest.raises(Refused, match="1 failed"):
        walk.check.sign("c1", "Ann", "", WALL_MS)
    walk.check.begin("c2", "Ben", WALL_MS)
    assert walk.check.counts() == {"done": 0, "failed": 0, "not_applicable": 0, "of": 3}


def test_nothing_is_logged_of_a_check_that_is_not_begun() -> None:
    check = DepartureCheck([item()])
    for doing in (
        lambda: check.set_item("manual", "done", "", "Ann", 0),
        lambda: check.sign("c1", "Ann", "", 0),
        check.reopen,
    ):
        with pytest.raises(Refused):
            doing()
    assert check.look(READY, 0.0, 0) == []


def test_another_list_keeps_the_results_of_what_it_still_has() -> None:
    doors, brake = item(), item("brake")
    walk = Walk(doors, brake)
    walk.say(doors, "done")
    walk.see(replace(READY, brake_percent=50.0))
    walk.check.change_list([replace(brake, need=60.0), doors, item("clock")])
    assert walk.result(doors)[0] == "done"
    assert walk.result(brake)[0] == "open", "what was seen does not show what is needed now"
    assert walk.check.counts()["of"] == 3


def test_results_do_not_pass_to_other_items_of_a_list_that_is_changed_while_it_is_signed() -> None:
    doors, brake = item(), item("brake")
    walk = Walk(doors, brake)
    walk.say(doors, "done")
    walk.see(replace(READY, brake_percent=50.0))
    walk.check.sign("c1", "Ann", "", WALL_MS)
    walk.check.change_list([replace(doors, title="Tyres"), replace(brake, fix="Press it.")])
    tyres = walk.check.items[0]
    assert walk.result(tyres)[0] == "open"
    assert walk.check.counts()["done"] == 2, "what was signed stays as it was signed"
    walk.check.reopen()
    walk.see(READY)
    assert walk.result(tyres)[0] == "open"
    assert walk.result(brake)[0] == "done", "how it is fixed is not what it requires"
    walk.say(tyres, "done")
    assert walk.result(tyres)[0] == "done"


@pytest.mark.parametrize("given_for", [item().fingerprint(), "manual"], ids=["fingerprint", "title"])
def test_a_restart_keeps_results_of_the_same_items_only(given_for: str) -> None:
    had = {"manual": Result(result="done", given_for=given_for)}
    for one, result in ((item(), "done"), (replace(item(), title="Tyres"), "open")):
        check = DepartureCheck([one])
        check.restore(id="c1", by="Ann", begun_ms=WALL_MS, results=had, signature=None)
        assert check.result(one).result == result
        assert check.counts()["done"] == (result == "done")


# -- the list as data --------------------------------------------------------------------------------------------------


def test_the_lists_that_are_shipped_are_sound() -> None:
    for profile in profiles.load().values():
        if profile.departure:
            assert of_rows(profile.departure)
    assert 10 <= len(profiles.load()["catvehicle"].departure) <= 12
    assert from_toml(to_toml(USUAL)) == USUAL


ROW = {"id": "a", "title": "A"}


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("item = 3", "must be a list of items"),
        ("item = []", "needs at least one item"),
        ("[[item]]\nid = 'a'", "Item 1 needs a title"),
        ("[[item]]\nid = 'A b'\ntitle = 'A'", "an id has 1 to 40 small letters"),
        ("[[item]]\ntitle = 'A'", "an id has 1 to 40 small letters"),
        ("[[item]]\nid = 'a'\ntitle = 7", "`title` must be text"),
        (f"[[item]]\nid = 'a'\ntitle = '{'x' * 61}'", "`title` has at most 60 characters"),
        ("[[item]]\nid = 'a'\ntitle = 'A'\nkind = 'dance'", "a kind is one of manual, check"),
        ("[[item]]\nid = 'a'\ntitle = 'A'\nneeds = 3", "no field named “needs”"),
        ("[[item]]\nid = 'a'\ntitle = 'A'\nneed = 3", "it has no `need`"),
        ("[[item]]\nid = 'a'\ntitle = 'A'\nof = 'x'", "it has no `of`"),
        ("[[item]]\nid = 'a'\ntitle = 'A'\nkind = 'check'", "name its check in `of`"),
        ("[[item]]\nid = 'a'\ntitle = 'A'\nkind = 'brake'\nneed = 101", "a number from 1 to 100 %"),
        ("[[item]]\nid = 'a'\ntitle = 'A'\nkind = 'brake'\nneed = nan", "a number from 1 to 100 %"),
        ("[[item]]\nid = 'a'\ntitle = 'A'\nkind = 'brake'\nneed = true", "a number from 1 to 100 %"),
        ("[[item]]\nid = 'a'\ntitle = 'A'\n[[item]]\nid = 'a'\ntitle = 'B'", "the id “a” is there already"),
        ("[[item]]\nid = 'a'\ntitle = 'A'\nevery_days = 0", "`every_days` is a whole number of days from 1 to 3650"),
        ("[[item]]\nid = 'a'\ntitle = 'A'\nevery_days = 1.5", "a whole number of days"),
        ("[[item]]\nid = 'a'\ntitle = 'A'\nevery_days = inf", "a whole number of days"),
        ("[[item]]\nid = 'a'\ntitle = 'A'\nevery_km = true", "`every_km` is a number of kilometres from 1 to 1000000"),
        ("[[item]]\nid = 'a'\ntitle = 'A'\nevery_km = nan", "a number of kilometres"),
        ("[list]\nx = 1", "no section named “list”"),
        ("item = [1]", "Item 1 is not a table"),
        ("[[item", "This is not TOML"),
    ],
    ids=range(24),
)
def test_a_bad_list_is_refused_with_a_sentence(text: str, why: str) -> None:
    with pytest.raises(Refused) as refused:
        from_toml(text)
    assert why in refused.value.reason
    assert refused.value.reason.isprintable()


def test_an_interval_is_no_part_of_what_an_item_requires() -> None:
    plain, often = of_rows([ROW]), of_rows([{**ROW, "every_days": 30, "every_km": 500}])
    assert from_toml(to_toml(often)) == often
    assert (plain[0].is_recurring, often[0].is_recurring) == (False, True)
    assert plain[0].fingerprint() == often[0].fingerprint()


def test_the_list_is_bounded() -> None:
    rows = [{"id": f"i{n}", "title": "A"} for n in range(MOST_ITEMS)]
    assert len(of_rows(rows)) == MOST_ITEMS
    with pytest.raises(Refused, match="at most 60 items"):
        of_rows([*rows, ROW])
    with pytest.raises(Refused, match="at most 14 kB"):
        of_rows([{**row, "fix": "x" * 300} for row in rows])
    with pytest.raises(Refused, match="list of items"):
        of_rows("text")
    assert departure_list.of_rows([{**ROW, "title": " a\tb\u202e "}])[0].title == "a b"
