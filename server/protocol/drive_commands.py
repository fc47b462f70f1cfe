"""What may be ordered of one car in a drive: marks, interventions, a planned stop, a slow-down, the departure check.

The rules are in server/vehicle/marks.py, monitor/planned_stop.py, server/slowdown/ and server/control/departure.py.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from monitor.interventions import By
from monitor.planned_stop import StopReason
from server.protocol.command_base import Name, Needs, Number, OfCar, Prompt, Signature
from server.protocol.departure import DepartureResult
from server.protocol.doc import doc

MARK = r"^[A-Za-z0-9-]{1,40}$"
MarkId = Annotated[str, Field(pattern=MARK, description="its id, made up by who marks; the same again changes it")]

MOST_LETTERS = 2000

ItemId = Annotated[str, Field(min_length=1, max_length=40)]


class OfMark(OfCar):
    """Places, changes or removes a mark; control is not needed, nor a car."""

    needs: ClassVar[Needs] = "operator"
    passes_replay: ClassVar[bool] = True  # the live drive is marked, whatever the page shows
    signature: ClassVar[Signature] = "wanted"  # it changes nothing of the car, and none may be lost


class PlaceMark(OfMark):
    """Marks a moment. The same `mark` again changes what is given; without any change nothing happens."""

    http: ClassVar[str] = "Mark a moment of the drive, or change a mark"
    kind: Literal["mark"]
    mark: MarkId
    at_ms: (
        Annotated[
            float, Field(ge=-(2**53), le=2**53, allow_inf_nan=False, description="the moment, by the server's clock")
        ]
        | None
    ) = None
    age_ms: (
        Annotated[
            float,
            Field(ge=-(2**53), le=2**53, allow_inf_nan=False, description="how long ago, by the device's own clock"),
        ]
        | None
    ) = None
    category: Annotated[str, Field(max_length=40, description='a short name; "": none any more')] | None = None
    words: Annotated[str, Field(max_length=2000, description='what is to be seen there; "": none any more')] | None = (
        None
    )


class RemoveMark(OfMark):
    """Takes a mark back."""

    http: ClassVar[str] = "Take a mark back"
    path: ClassVar[str] = "/api/marks/{mark}/remove"
    has_body: ClassVar[bool] = False
    kind: Literal["remove_mark"]
    mark: Annotated[MarkId, doc("the id of the mark")]


MarkCommand = PlaceMark | RemoveMark


class DescribeIntervention(OfCar):
    """Describes why somebody intervened; sent again it replaces the description before."""

    needs: ClassVar[Needs] = "operator"
    http: ClassVar[str] = "Describe why somebody intervened"
    path: ClassVar[str] = "/api/interventions/{intervention}/describe"
    kind: Literal["describe_intervention"]
    intervention: Annotated[str, Field(pattern=r"^[A-Za-z0-9-]{1,40}$", description="its id, as the state names it")]
    what: Annotated[str, Field(max_length=MOST_LETTERS, description="as text; empty where the category is enough")] = ""
    category: Annotated[str, Field(min_length=1, max_length=40)] | None = None
    initiated_by: Annotated[By | None, doc("where the data show another one; null: as they show")] = None


class OfPlannedStop(OfCar):
    """Of the planned stop of a car."""


class BeginPlannedStop(OfPlannedStop, Prompt):
    """The car stands on purpose: its alarms are marked, and only critical ones sound. It ends by itself once the car
    moves."""

    http: ClassVar[str] = "The car stands on purpose: its alarms are marked, and only critical ones sound"
    kind: Literal["planned_stop"]
    reason: Annotated[StopReason, doc("why it stands; another one replaces it")]


class EndPlannedStop(OfPlannedStop):
    """Ends the planned stop."""

    needs: ClassVar[Needs] = "operator"  # alarms sound again by it
    from_fleet: ClassVar[bool] = True
    http: ClassVar[str] = "End the planned stop"
    has_body: ClassVar[bool] = False
    kind: Literal["end_planned_stop"]


PlannedStopCommand = BeginPlannedStop | EndPlannedStop


class OfSlowing(OfCar, Prompt):
    """Part of a slow-down."""


class Arm(OfSlowing):
    """Slow-down may be ordered from now on."""

    http: ClassVar[str] = "Slow-down may be ordered from now on"
    path: ClassVar[str] = "/api/slow-down/arm"
    has_body: ClassVar[bool] = False
    kind: Literal["arm"]


class Disarm(OfSlowing):
    """Slow-down may not be ordered any more."""

    http: ClassVar[str] = "Nothing can be ordered any more"
    path: ClassVar[str] = "/api/slow-down/disarm"
    has_body: ClassVar[bool] = False
    kind: Literal["disarm"]


class Decelerate(OfSlowing):
    """Slows the car, once armed."""

    needs: ClassVar[Needs] = "operator"
    http: ClassVar[str] = "Slow the car, and hold it until it is released; no emergency stop"
    path: ClassVar[str] = "/api/slow-down/order"
    has_body: ClassVar[bool] = False
    kind: Literal["slow_down"]


class Release(OfSlowing):
    """Ends the order, or the guard's hold, of this number: the driver, or the car, may drive on."""

    http: ClassVar[str] = "The driver or controller may continue"
    path: ClassVar[str] = "/api/slow-down/release"
    kind: Literal["release"]
    number: Annotated[Number, doc("of the very order that ends, as the state names it")]


class Veto(OfSlowing):
    """Stops a count-down: the car is not slowed by itself this time."""

    needs: ClassVar[Needs] = "operator"
    http: ClassVar[str] = "Not slowed by itself this time"
    path: ClassVar[str] = "/api/slow-down/veto"
    passes_replay: ClassVar[bool] = True
    kind: Literal["veto"]
    trigger: Annotated[Name, doc("as the count-down names it")]


SlowingCommand = Arm | Disarm | Decelerate | Release | Veto


class OfDeparture(OfCar):
    """Part of a departure check; only pages send it."""

    needs: ClassVar[Needs] = "operator"


class BeginDeparture(OfDeparture):
    """Begins the departure check, or begins it again: all its results are gone."""

    kind: Literal["begin_departure"]


class SetDepartureItem(OfDeparture):
    """A person's result of one item; refused where it turns by itself, or the check is signed."""

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
    """Replaces the list of the car; an item with the same question as before keeps its result."""

    needs: ClassVar[Needs] = "control"
    kind: Literal["set_departure_list"]
    items: Annotated[
        list[dict[str, Any]] | None,
        Field(max_length=100, description="as in the file; null: the list of the vehicle profile again"),
    ]


DepartureCommand = BeginDeparture | SetDepartureItem | SignDeparture | ReopenDeparture | SetDepartureList
