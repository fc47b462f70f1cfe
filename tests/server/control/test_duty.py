"""Who is on duty: the list of people, signing on and off, and what ends a duty; with a clock of the tests."""

from __future__ import annotations

from typing import Any

import pytest

from monitor.runner import Refused
from server.control.authorization import Caller
from server.control.duty import (
    HOUR_MS,
    LONGEST_NAME,
    MOST_PEOPLE,
    NOTE_LASTS_MS,
    OFF_STATED_MS,
    DutyBoard,
    OnDuty,
    Person,
    person_name,
)


@pytest.fixture
def board() -> DutyBoard:
    found = DutyBoard()
    found.add("ak", "A. K.", "operator", 1)
    found.add("mr", "M. R.", "supervisor", 2)
    return found


def test_signing_on_takes_the_role_of_last_time(board: DutyBoard) -> None:
    board.sign_on("phone", "Pixel 7", "ak", None, 1000)
    assert board.on_duty("phone") == OnDuty(name="A. K.", role="operator")
    board.sign_on("phone", "Pixel 7", "ak", "safety_driver", 2000)
    board.sign_off("phone", 3000)
    board.sign_on("phone", "Pixel 7", "ak", None, 4000)
    assert board.on_duty("phone") == OnDuty(name="A. K.", role="safety_driver")
    assert board.people["ak"].last_ms == 4000


def test_a_person_is_on_duty_at_one_device(board: DutyBoard) -> None:
    board.sign_on("phone", "Pixel 7", "ak", None, 1000)
    with pytest.raises(Refused, match="on duty at Pixel 7"):
        board.sign_on("desk", "Desk", "ak", None, 2000)
    assert board.on_duty("desk") is None
    board.sign_on("desk", "Desk", "ak", None, 2000, moves=True)
    assert board.on_duty("phone") is None
    assert board.on_duty("desk") is not None
    assert board.entries["phone"].ended == "A. K. signed on at Desk: nobody is on duty here now."
    assert [one.device for one in board.duties()] == ["desk"]


def test_signing_on_again_keeps_the_beginning(board: DutyBoard) -> None:
    board.sign_on("phone", "Pixel 7", "ak", None, 1000)
    assert board.sign_on("phone", "Pixel 7", "ak", None, 9000).since_ms == 1000
    assert board.sign_on("phone", "Pixel 7", "ak", "supervisor", 9500).since_ms == 9500


def test_a_duty_ends_by_itself_with_a_note(board: DutyBoard) -> None:
    board.set_hours(2)
    board.sign_on("phone", "Pixel 7", "ak", None, 1000)
    assert board.next_ms() == 1000 + 2 * HOUR_MS
    assert board.advance(1000 + 2 * HOUR_MS - 1) == []
    assert [one.person for one in board.advance(1000 + 2 * HOUR_MS)] == ["ak"]
    assert board.on_duty("phone") is None
    note = board.entries["phone"]
    assert note.ended == "The duty of A. K. ended by itself after 2 h. Sign on again."
    assert board.advance(note.changed_ms + NOTE_LASTS_MS - 1) == []
    assert "phone" in board.entries
    board.advance(note.changed_ms + NOTE_LASTS_MS)
    assert board.entries == {}


def test_a_note_is_dismissed_once(board: DutyBoard) -> None:
    board.sign_on("phone", "Pixel 7", "ak", None, 1000)
    assert board.sign_off("phone", 2000, "Handed over.")
    assert not board.sign_off("phone", 2500)
    assert board.dismiss("phone", 3000)
    assert not board.dismiss("phone", 3000)
    assert not board.dismiss("unknown", 3000)


def test_who_is_on_duty_is_not_removed(board: DutyBoard) -> None:
    board.sign_on("phone", "Pixel 7", "ak", None, 1000)
    with pytest.raises(Refused, match="sign off first"):
        board.remove("ak", 2000)
    board.sign_off("phone", 3000)
    board.remove("ak", 4000)
    with pytest.raises(Refused, match="not in the list"):
        board.sign_on("phone", "Pixel 7", "ak", None, 5000)
    assert board.removed == {"ak": 4000}


def test_a_rename_holds_at_once(board: DutyBoard) -> None:
    board.sign_on("phone", "Pixel 7", "ak", None, 1000)
    board.change("ak", name="Anna K.", role=None, now_ms=2000)
    assert board.on_duty("phone") == OnDuty(name="Anna K.", role="operator")
    with pytest.raises(Refused, match="in the list already"):
        board.change("ak", name="\uff4d. R.", role=None, now_ms=3000)  # looks alike, and is the same by NFKC


@pytest.mark.parametrize(
    ("name", "kept"),
    [
        ("  A.\tK.\n", "A. K."),
        ("<img src=x>", "<img src=x>"),
        ("A\u202eB", "A B"),
        ("Ä\x1b[31m", "Ä [31m"),
        ("山田 太郎", "山田 太郎"),
    ],
)
def test_a_name_is_one_line(name: str, kept: str) -> None:
    assert person_name(name) == kept


@pytest.mark.parametrize(
    "name", ["", "   ", "\x00", "...", "\u202e", None, 7, "x" * (LONGEST_NAME + 1), "A. K. (Desk)"]
)
def test_what_is_no_name_is_refused(name: object) -> None:
    with pytest.raises(Refused):
        person_name(name)


def test_the_list_and_the_roles_are_bounded() -> None:
    board = DutyBoard()
    for number in range(MOST_PEOPLE):
        board.add(str(number), f"P {number}", "operator", 0)
    with pytest.raises(Refused, match="at most"):
        board.add("more", "One more", "operator", 0)
    with pytest.raises(Refused, match="A role is one of operator"):
        board.change("0", name=None, role="king", now_ms=1)
    for hours in (0.5, 25, float("nan")):
        with pytest.raises(Refused):
            board.set_hours(hours)


@pytest.mark.parametrize(
    ("person", "name"),
    [
        ({"name": "A. K.", "role": "operator"}, "A. K. (Desk)"),
        ({"name": "\x1b", "role": "operator"}, "Desk"),
        ({"name": "A. K.", "role": "king"}, "Desk"),
        ({"name": "A. K."}, "Desk"),
        ("A. K.", "Desk"),
        (None, "Desk"),
    ],
)
def test_an_order_is_signed_by_the_person_at_the_device(person: Any, name: str) -> None:
    caller = Caller.of({"by": "Desk", "person": person})
    assert (caller.name, caller.device) == (name, "Desk")
    assert (caller.person is not None) == (name != "Desk")


def test_each_status_states_who_is_on_duty_and_when_the_duty_of_others_ended(board: DutyBoard) -> None:
    assert board.stated(500) == {}
    board.sign_on("phone", "Pixel 7", "ak", None, 1000)
    board.sign_on("desk", "Desk", "mr", None, 2000)
    assert board.stated(2000) == {"A. K.": None, "M. R.": None}
    board.sign_off("phone", 3000)
    assert board.stated(3000) == {"A. K.": 3000, "M. R.": None}
    board.sign_on("desk", "Desk", "ak", None, 4000)  # instead of who was on duty there
    assert board.stated(4000) == {"A. K.": None, "M. R.": 4000}
    board.sign_on("phone", "Pixel 7", "ak", None, 5000, moves=True)
    assert board.stated(5000) == {"A. K.": None, "M. R.": 4000}
    board.advance(5000 + 12 * HOUR_MS)
    assert board.stated(5000 + 12 * HOUR_MS) == {"A. K.": 5000 + 12 * HOUR_MS, "M. R.": 4000}
    assert board.stated(4000 + OFF_STATED_MS) == {"A. K.": 5000 + 12 * HOUR_MS}


def test_who_was_renamed_or_removed_is_off_duty_under_each_name(board: DutyBoard) -> None:
    board.sign_on("phone", "Pixel 7", "ak", None, 1000)
    board.change("ak", name="Anna K.", role=None, now_ms=2000)
    assert board.stated(2000) == {"Anna K.": None, "A. K.": None}
    board.sign_off("phone", 3000)
    assert board.stated(3000) == {"Anna K.": 3000, "A. K.": 3000}
    board.remove("ak", 4000)
    assert board.stated(4000) == {"Anna K.": 3000, "A. K.": 3000}
    assert board.stated(3000 + OFF_STATED_MS) == {}


@pytest.mark.parametrize("name", ["A. K.", "a. k.", "Anna K."])
@pytest.mark.parametrize("is_removed", [False, True])
def test_a_name_in_acknowledgements_is_given_to_nobody_else(board: DutyBoard, name: str, is_removed: bool) -> None:
    board.sign_on("phone", "Pixel 7", "ak", None, 1000)
    board.change("ak", name="Anna K.", role=None, now_ms=2000)
    board.sign_off("phone", 3000)
    if is_removed:
        board.remove("ak", 4000)
    with pytest.raises(Refused, match="removed lately" if is_removed else "in the list|is a former name of"):
        board.add("other", name, "operator", 5000)
    with pytest.raises(Refused, match="removed lately" if is_removed else "in the list|is a former name of"):
        board.change("mr", name=name, role=None, now_ms=5000)
    assert board.stated(5000) == {"Anna K.": 3000, "A. K.": 3000}
    if is_removed:  # nobody states it any more
        board.add("other", name, "operator", 3000 + OFF_STATED_MS)


def test_a_former_name_of_who_never_was_on_duty_is_free(board: DutyBoard) -> None:
    board.change("ak", name="Anna K.", role=None, now_ms=2000)
    board.add("other", "A. K.", "operator", 3000)
    board.change("ak", name="M. K.", role=None, now_ms=4000)
    board.remove("ak", 5000)
    board.add("again", "M. K.", "operator", 6000)


@pytest.mark.parametrize("name", ["A. K.", "Anna K."])
def test_who_was_removed_by_mistake_is_added_again_as_the_same_person(board: DutyBoard, name: str) -> None:
    board.sign_on("phone", "Pixel 7", "ak", None, 1000)
    board.change("ak", name="Anna K.", role=None, now_ms=2000)
    board.sign_off("phone", 3000)
    board.remove("ak", 4000)
    board.add("again", name, "operator", 5000, returns=True)
    assert board.stated(5000) == {"Anna K.": 3000, "A. K.": 3000}
    board.sign_on("phone", "Pixel 7", "again", None, 6000)
    board.change("again", name="A. Kay", role=None, now_ms=7000)
    assert board.stated(7000) == {"A. Kay": None, "Anna K.": None, "A. K.": None}
    board.sign_off("phone", 8000)
    board.remove("again", 9000)
    board.add("third", "A. Kay", "operator", 10_000, returns=True)
    board.sign_on("phone", "Pixel 7", "third", None, 11_000)
    assert board.stated(11_000) == {"A. Kay": None, "Anna K.": None, "A. K.": None}


def test_who_has_the_name_of_another_and_was_never_on_duty_hides_nothing(board: DutyBoard) -> None:
    """As two web nodes may bring it about that are apart for a time."""
    board.sign_on("phone", "Pixel 7", "ak", None, 1000)
    board.sign_off("phone", 3000)
    board.remove("ak", 4000)
    board.people["other"] = Person(id="other", name="A. K.")
    assert board.stated(5000) == {"A. K.": 3000}
    board.sign_on("desk", "Desk", "other", None, 6000)
    assert board.stated(6000) == {"A. K.": None}  # a name is that of who bears it now


@pytest.mark.parametrize("order", [("ak", "mr"), ("mr", "ak")])
def test_of_two_with_the_same_former_name_the_one_off_duty_counts(order: tuple[str, str]) -> None:
    board = DutyBoard()
    for id in order:
        board.people[id] = Person(id=id, name=id, former=("A.",))
        board.sign_on(id, id, id, None, 1000)
    board.sign_off("ak", 2000)
    assert board.stated(2000) == {"ak": 2000, "mr": None, "A.": 2000}
    board.sign_off("mr", 3000)
    assert board.stated(3000)["A."] == 3000


def test_of_former_names_the_last_ones_are_known(board: DutyBoard) -> None:
    for number, name in enumerate(("B", "C", "A. K.", "D", "E")):
        board.change("ak", name=name, role=None, now_ms=1000 + number)
    assert board.people["ak"].former == ("D", "A. K.", "C")


def test_of_the_removed_those_are_kept_whose_duty_ended_lately(board: DutyBoard) -> None:
    for number in range(MOST_PEOPLE + 2):
        board.people[f"p{number}"] = Person(id=f"p{number}", name=f"P {number}", off_ms=1000)
        dropped = board.forget(f"p{number}", 2000)
        assert [one.id for one in dropped] == [f"p{one}" for one in [number - MOST_PEOPLE] if one >= 0]
    assert list(board.gone) == [f"p{number}" for number in range(2, MOST_PEOPLE + 2)]
    board.remove("mr", 3000)  # never on duty: nothing bears the name
    assert "mr" not in board.gone
    board.sign_on("phone", "Pixel 7", "ak", None, 4000)
    board.sign_off("phone", 1000 + OFF_STATED_MS)
    board.remove("ak", 1000 + OFF_STATED_MS)
    assert list(board.gone) == ["ak"]


def test_a_name_that_is_stated_is_not_dropped_by_a_rename(board: DutyBoard) -> None:
    board.sign_on("phone", "Pixel 7", "ak", None, 1000)
    for name in ("B", "C", "D"):
        board.change("ak", name=name, role=None, now_ms=2000)
    for now_ms in (3000, 4000 + OFF_STATED_MS - 1):
        with pytest.raises(Refused, match=r"D had 3 other names, and A\. K\. names what they acknowledged"):
            board.change("ak", name="E", role=None, now_ms=now_ms)
        board.sign_off("phone", 4000)
    board.change("ak", name="B", role="supervisor", now_ms=5000)  # a former name is none more
    assert board.stated(5000) == {"A. K.": 4000, "B": 4000, "C": 4000, "D": 4000}
    board.change("ak", name="E", role=None, now_ms=4000 + OFF_STATED_MS)
    assert board.people["ak"].former == ("B", "D", "C")
