"""What an operator may do with the item of a car in the attention queue; server/control/attention.py has the rules."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from server.protocol.command_base import Needs, OfCar, PageName
from server.protocol.doc import doc


class OfItem(OfCar):
    """Assigns a person to a car that needs one. It arms nothing, and is no control of the car."""

    needs: ClassVar[Needs] = "operator"
    passes_replay: ClassVar[bool] = True  # a page that is asked to take an item over answers
    from_fleet: ClassVar[bool] = True


class TakeItem(OfItem):
    """Assigns the car's item to who sends it; refused where it is assigned to another, or the car needs nobody."""

    http: ClassVar[str] = "Take the car's item in the attention queue; a program repeats it every few seconds"
    path: ClassVar[str] = "/api/attention/take"
    kind: Literal["take_item"]
    over: Annotated[bool, doc("true: also from another")] = False


class ReleaseItem(OfItem):
    """Gives the car's item back to the queue; only by who has it."""

    http: ClassVar[str] = "Give the car's item back to the queue"
    path: ClassVar[str] = "/api/attention/release"
    has_body: ClassVar[bool] = False
    kind: Literal["release_item"]


class OfferItem(OfItem):
    """Asks another person to take the car's item over; it stays assigned as it is until they accept."""

    http: ClassVar[str] = "Ask another person to take the car's item over"
    path: ClassVar[str] = "/api/attention/offer"
    kind: Literal["offer_item"]
    to: Annotated[PageName, doc("the page of that person, as `people` of the summary names it")]


class AnswerItem(OfItem):
    """Accepts or declines an offered item; only by who was asked."""

    http: ClassVar[str] = "Accept or decline the item that was offered"
    path: ClassVar[str] = "/api/attention/answer"
    kind: Literal["answer_item"]
    accept: bool


class WithdrawItem(OfItem):
    """Takes an offer back; only by who made it."""

    http: ClassVar[str] = "Take an offer back"
    path: ClassVar[str] = "/api/attention/withdraw"
    has_body: ClassVar[bool] = False
    kind: Literal["withdraw_item"]


ItemCommand = TakeItem | ReleaseItem | OfferItem | AnswerItem | WithdrawItem
