"""People and duties of several web nodes, without a broker: what one tells, the others have."""

from __future__ import annotations

import pytest

from server.access.people import People
from server.access.shared_access import BadPeopleEntry, SharedPeople
from server.control.duty import MOST_PEOPLE


class Node:
    def __init__(self, ms: int = 1000) -> None:
        self.ms = ms
        self.people = People(None, wall_ms=lambda: self.ms)
        self.shared = SharedPeople(self.people)

    def hear(self, *others: Node) -> None:
        for other in others:
            for key, value in other.shared.due().items():
                self.shared.take(key, value)


async def test_what_is_changed_at_one_node_holds_at_the_other() -> None:
    one, two = Node(), Node()
    ann = await one.people.add("A. K.", "operator")
    one.ms = 2000
    await one.people.sign_on("phone", "Pixel", ann, "supervisor", moves=False)
    two.hear(one)
    assert two.people.duty_of("phone", "Pixel")["me"] == one.people.duty_of("phone", "Pixel")["me"]
    person = {"name": "A. K.", "role": "supervisor", "device": "phone"}
    assert two.people.sent("phone") == {
        "person": person,
        "supervisors": ["A. K."],
        "duties": {"A. K.": None},
        "listed": 1,
    }
    assert one.shared.due() == {} == two.shared.due()
    two.ms = 3000
    await two.people.sign_off("phone", "It was handed over.")
    one.hear(two)
    assert one.people.sent("phone") == {"person": None, "supervisors": [], "duties": {"A. K.": 3000}, "listed": 1}
    two.ms = 4000
    await two.people.remove(ann)
    await two.people.set_hours(8)
    one.hear(two)
    assert one.people.board.people == {}
    assert one.people.duty_of("phone", "Pixel")["ended"] == {"text": "It was handed over.", "at_ms": 3000}
    assert one.people.board.ends_after_h == 8


async def test_who_signs_on_at_two_nodes_at_once_is_on_duty_at_the_later() -> None:
    one, two = Node(), Node()
    ann = await one.people.add("A. K.", "operator")
    two.hear(one)
    one.ms, two.ms = 2000, 2001
    await one.people.sign_on("phone", "Pixel", ann, None, moves=False)
    await two.people.sign_on("tablet", "Tablet", ann, None, moves=False)
    due_one, due_two = one.shared.due(), two.shared.due()
    for node, due in ((one, due_two), (two, due_one)):
        for key, value in due.items():
            node.shared.take(key, value)
    for node in (one, two):
        assert [entry.device for entry in node.people.board.duties()] == ["tablet"]


async def test_a_removed_person_is_not_brought_back() -> None:
    one, two = Node(), Node()
    ann = await one.people.add("A. K.", "operator")
    two.hear(one)
    await one.people.remove(ann)
    two.ms = 9000
    await two.people.change(ann, name="Anna", role=None)
    one.hear(two)
    two.hear(one)
    assert one.people.board.people == {} == two.people.board.people


async def test_who_is_removed_at_one_node_while_on_duty_at_the_other_is_off_duty_at_once() -> None:
    one, two = Node(), Node()
    ann = await one.people.add("A. K.", "operator")
    one.ms = 2000
    await one.people.change(ann, name="Anna K.", role=None)
    two.hear(one)
    two.ms = 3000
    await two.people.sign_on("phone", "Pixel", ann, None, moves=False)
    assert two.people.sent("phone")["duties"] == {"Anna K.": None, "A. K.": None}
    one.ms = 4000
    await one.people.remove(ann)
    two.hear(one)
    assert two.people.sent("phone") == {
        "person": None,
        "supervisors": [],
        "duties": {"Anna K.": 4000, "A. K.": 4000},
        "listed": 0,
    }
    ended = two.people.duty_of("phone", "Pixel")["ended"]
    assert ended is not None
    assert "was removed from the list" in ended["text"]


async def test_who_is_added_again_is_the_same_person_at_each_node() -> None:
    one, two = Node(), Node()
    ann = await one.people.add("A. K.", "operator")
    await one.people.sign_on("phone", "Pixel", ann, None, moves=False)
    two.hear(one)
    one.ms = two.ms = 2000
    await one.people.sign_off("phone")
    await one.people.remove(ann)
    two.hear(one)
    again = await one.people.add("A. K.", "operator", returns=True)
    await one.people.change(again, name="Anna", role=None)
    one.ms = two.ms = 3000
    await one.people.sign_on("phone", "Pixel", again, None, moves=False)
    two.hear(one)
    for node in (one, two):
        assert node.people.sent("phone")["duties"] == {"Anna": None, "A. K.": None}


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("person.a", b""),
        ("person.a", b"7"),
        ("person.a", b'{"name": "\\u0000", "changed_ms": 1}'),
        ("person.../x", b'{"name": "A", "changed_ms": 1}'),
        ("duty.d", b'{"person": "../x", "changed_ms": 1}'),
        ("duty.d", b'{"changed_ms": -1}'),
        ("person.a", b'{"removed_ms": -1}'),
        ("person.a", b'{"removed_ms": "7"}'),
        ("person.../x", b'{"removed_ms": 1}'),
        ("people", b'{"ends_after_h": 8, "changed_ms": 99999999999999999999}'),
        ("people", b'{"ends_after_h": 900, "changed_ms": 1}'),
    ],
)
def test_what_is_no_entry_changes_nothing(key: str, value: bytes) -> None:
    node = Node()
    with pytest.raises(BadPeopleEntry):
        node.shared.take(key, value)
    assert node.people.board.people == {} == node.people.board.entries
    assert node.people.board.removed == {}


def test_of_the_removed_so_many_are_kept() -> None:
    node = Node()
    for number in range(2 * MOST_PEOPLE + 5):
        node.shared.take(f"person.p{number}", b'{"removed_ms": 1}')
    assert len(node.people.board.removed) == 2 * MOST_PEOPLE


async def test_who_is_not_stated_as_off_duty_any_more_is_logged_at_each_node(caplog: pytest.LogCaptureFixture) -> None:
    one, two = Node(), Node()
    for number in range(MOST_PEOPLE + 1):
        one.ms += 1
        id = await one.people.add(f"P {number}", "operator")
        await one.people.sign_on("phone", "Pixel", id, None, moves=False)
        one.ms += 1
        await one.people.sign_off("phone")
        two.hear(one)
        assert caplog.messages == []
        one.ms += 1
        await one.people.remove(id)
        two.hear(one)
    assert caplog.messages == 2 * ["removed_person_dropped name='P 0' off_ms=1002 most=50"]
