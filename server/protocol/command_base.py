"""What the models of commands share."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import BaseModel, ConfigDict, Field

from server.protocol.doc import doc

PAGE = r"^[0-9a-z-]{4,40}$"
Name = Annotated[str, Field(min_length=1, max_length=120)]
Number = Annotated[int, Field(ge=0, le=2**53)]
PageName = Annotated[str, Field(pattern=PAGE)]  # the name that a page, and the phone it is on, gives itself
# Any operator, or only the one who is in control. Slowing the car is to need no more than an operator, letting it go
# control.
Needs = Literal["operator", "control"]
# What an agent does with a command that a web node passes on without its device's signature: required, it is refused;
# wanted, it is kept and shown as not signed; none, it is never signed.
Signature = Literal["required", "wanted", "none"]


class BaseCommand(BaseModel):
    """What every command has; a model declares what differs."""

    model_config = ConfigDict(extra="ignore", strict=True, frozen=True)
    needs: ClassVar[Needs] = "control"  # what is not declared to need less
    http: ClassVar[str] = ""  # its summary over HTTP; "": of pages alone, or with a route of its own
    path: ClassVar[str] = ""  # of the request, whose body has the fields that are not in it; "": /api/KIND
    has_body: ClassVar[bool] = True  # False: a program gives none of the fields
    passes_replay: ClassVar[bool] = False  # a page may send it to the live car while it replays
    from_fleet: ClassVar[bool] = False  # the page of all cars may send it
    signature: ClassVar[Signature] = "required"
    id: Annotated[str, Field(max_length=80)] | None = None


class Prompt(BaseCommand):
    """Is for the moment at which it was pressed: refused where it took longer than `acts_within_s` to come.

    The page gives no time of day. `heard_ms` is when the newest state that the page had was likely made, by the clock
    of the server: its `time_ms`, and `excess_ms` where it came through a web node. `held_s` is how old that state was
    then, by the bounds that the page has of the server's clock.
    """

    acts_within_s: ClassVar[float] = 0.5
    pressed_ago_s: Annotated[
        float, Field(ge=0, le=86_400, allow_inf_nan=False, description="since the finger let go, when it was sent")
    ] = 0.0
    heard_ms: Annotated[float, Field(ge=0, le=2**53, allow_inf_nan=False)] | None = None
    held_s: Annotated[float, Field(ge=0, le=86_400, allow_inf_nan=False)] = 0.0

    def late_s(self, wall_ms: float) -> float:
        """How long ago it was pressed. Over a quiet link the error is less than its shortest round trip."""
        way_s = 0.0 if self.heard_ms is None else max(0.0, (wall_ms - self.heard_ms) / 1000 - self.held_s)
        return self.pressed_ago_s + way_s

    def too_late(self, wall_ms: float) -> str | None:
        """Why it is refused, as a sentence; None: it came in time."""
        if (late_s := self.late_s(wall_ms)) <= self.acts_within_s:
            return None
        return f"This was pressed {late_s:.1f} s ago: press again if still needed."


OF_PAGE = frozenset(Prompt.model_fields) - frozenset(BaseCommand.model_fields)  # what only a page can say


class OfCar(BaseCommand):
    """Acts on the car itself: refused where it was meant for another one."""

    vehicle: Annotated[Name | None, doc("the car that the page named to its operator; refused by any other")] = None
