"""The departure check; server/control/departure.py has the rules."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from server.protocol.command_base import Needs, OfCar
from server.protocol.departure import DepartureResult
from server.protocol.doc import doc

ItemId = Annotated[str, Field(min_length=1, max_length=40)]


class OfDeparture(OfCar):
    """Part of a departure check; only pages send it."""

    needs: ClassVar[Needs] = "operator"


class BeginDeparture(OfDeparture):
    """Begins the departure check, or begins it again: all its results are gone."""

    kind: Literal["begin_departure"]


class SetDepartureItem(OfDeparture):
    """A person's word on one item; refused where it turns by itself, or the check is signed."""

    kind: Literal["set_departure_item"]
    item: ItemId
    result: Annotated[DepartureResult, doc("open: taken back")]
    note: Annotated[str, Field(max_length=200, description="why; required of failed and not_applicable")] = ""


class SignDeparture(OfDeparture):
    """Signs the check; refused while an item is failed or open, or where it is another check by now."""

    kind: Literal["sign_departure"]
    check: Annotated[str, Field(min_length=1, max_length=40, description="its id, as the page shows it")]


class ReopenDeparture(OfDeparture):
    """Takes the signature back; the results stay."""

    kind: Literal["reopen_departure"]


class SetDepartureList(OfDeparture):
    """Replaces the list of the car; an item that asks the same as before keeps its result."""

    needs: ClassVar[Needs] = "control"
    kind: Literal["set_departure_list"]
    items: Annotated[
        list[dict[str, Any]] | None,
        Field(max_length=100, description="as in the file; null: the list of the vehicle profile again"),
    ]


DepartureCommand = BeginDeparture | SetDepartureItem | SignDeparture | ReopenDeparture | SetDepartureList
