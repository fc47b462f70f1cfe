"""What the models of commands share."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import BaseModel, ConfigDict, Field

from server.protocol.doc import doc

PAGE = r"^[0-9a-z-]{4,40}$"
Name = Annotated[str, Field(min_length=1, max_length=120)]
Number = Annotated[int, Field(ge=0, le=2**53)]
PageName = Annotated[str, Field(pattern=PAGE)]  # by which a page, and the phone it is on, knows itself
# Any operator, or only the one who is in control. Slowing the car is to need no more than an operator, letting it go
# control.
Needs = Literal["operator", "control"]


class BaseCommand(BaseModel):
    """What every command has; a model says what differs."""

    model_config = ConfigDict(extra="ignore", strict=True, frozen=True)
    needs: ClassVar[Needs] = "control"  # what is not said to need less
    http: ClassVar[str] = ""  # its summary over HTTP; "": of pages alone, or with a route of its own
    path: ClassVar[str] = ""  # of the request, whose body has the fields that are not in it; "": /api/KIND
    has_body: ClassVar[bool] = True  # False: a program gives none of the fields
    passes_replay: ClassVar[bool] = False  # a page may send it to the live car while it replays
    from_fleet: ClassVar[bool] = False  # the page of all cars may send it
    is_signed: ClassVar[bool] = True  # an order: where a web node passes it on, the agent requires a signature
    id: Annotated[str, Field(max_length=80)] | None = None


class OfCar(BaseCommand):
    """Acts on the car itself: refused where it was meant for another one."""

    vehicle: Annotated[Name | None, doc("the car that the page named to its operator; refused by any other")] = None
