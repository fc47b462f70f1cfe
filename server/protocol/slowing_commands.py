"""What orders a slow-down, ends it, or says whether one may be ordered."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from server.protocol.command_base import Name, Needs, Number, OfCar, Prompt
from server.protocol.doc import doc


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
    acts_within_s: ClassVar[float] = 0.3
    kind: Literal["slow_down"]


class Release(OfSlowing):
    """Ends the order, or the guard's hold, of this number: whoever drives may drive on."""

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
