"""Who is on duty: the roles, the list of people, and what a page receives of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal, NotRequired

from typing_extensions import TypedDict

from server.protocol.doc import doc

DutyRole = Literal["operator", "safety_driver", "supervisor", "test_engineer"]
# Declared here and nowhere else; the page gets the titles with the list of people.
ROLES: Mapping[DutyRole, str] = {
    "operator": "operator",
    "safety_driver": "safety driver",
    "supervisor": "supervisor",
    "test_engineer": "test engineer",
}


class DutyState(TypedDict):
    """A person who is on duty."""

    person: Annotated[str, doc("id in the list of people")]
    name: str
    role: DutyRole
    title: Annotated[str, doc("of the role")]
    device: Annotated[str, doc("name of the device at which they signed on")]
    since_ms: int


class DutyEnded(TypedDict):
    """How the last duty at this device ended."""

    text: Annotated[str, doc("one sentence")]
    at_ms: int


class Duty(TypedDict):
    """Who is on duty at this device: after the page's hello, and whenever it changes."""

    kind: Literal["duty"]
    me: Annotated[DutyState | None, doc("null: not signed on")]
    signs: Annotated[str, doc("the name under which this page's orders are logged")]
    ended: Annotated[DutyEnded | None, doc("shown until it is dismissed, or somebody signs on")]
    people: Annotated[int, doc("how many are in the list of people; 0: nobody can sign on")]
    on_duty: Annotated[list[DutyState], doc("everybody, at whatever device")]


class PersonRow(TypedDict):
    """One of the list of people."""

    id: str
    name: str
    role: Annotated[DutyRole, doc("of the last time")]
    last_ms: Annotated[int | None, doc("when they signed on last; null: never")]
    duty: Annotated[DutyState | None, doc("null: not on duty")]


class RoleRow(TypedDict):
    role: DutyRole
    title: str


class PeopleList(TypedDict):
    """The answer of `GET /api/people`, and of each change."""

    people: list[PersonRow]
    roles: list[RoleRow]
    ends_after_h: Annotated[float, doc("a duty ends by itself after so long")]
    added: NotRequired[Annotated[str, doc("id of the new person, where one was added")]]
    me: DutyState | None
