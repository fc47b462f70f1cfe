"""Who looks after a car: control handed over with read-back, and the car's item in the attention queue.

The rules are in server/control/handover.py and server/control/attention.py.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from server.protocol.command_base import Name, Needs, Number, OfCar, PageName, Prompt
from server.protocol.doc import doc

LineKey = Annotated[str, Field(min_length=1, max_length=200)]
Version = Annotated[str, Field(min_length=1, max_length=40)]


class OfHandover(OfCar):
    """Part of a hand-over of control; only pages send it."""

    needs: ClassVar[Needs] = "operator"
    passes_replay: ClassVar[bool] = True  # a page that is offered control answers


class OfferControl(OfHandover):
    """Offers control to another page, whose operator reads back what is in force; until then control stays where it
    is."""

    kind: Literal["offer_control"]
    to: Annotated[PageName, doc("the page that is to get it")]


class ReadBack(OfHandover):
    """Confirms one line of what is in force; only by who takes over."""

    kind: Literal["read_back"]
    line: Annotated[LineKey, doc("its key, as the state names it")]
    is_read: Annotated[bool, doc("false: taken back")] = True


class AcceptControl(OfHandover, Prompt):
    """Takes control over. Refused while a line is not confirmed, or where the list is another one by now."""

    kind: Literal["accept_control"]
    version: Annotated[Version, doc("of the list that was read back, as the state names it")]


class EndOffer(OfHandover):
    """Declines the offer, or takes it back: by who takes over, or by who offered."""

    kind: Literal["end_offer"]


HandoverCommand = OfferControl | ReadBack | AcceptControl | EndOffer


class TakeAlarm(OfCar):
    """Makes who sends it the owner of an acknowledged alarm; refused unless the duty of its owner has ended, and from
    where nobody is on duty while people sign on at all."""

    needs: ClassVar[Needs] = "operator"
    http: ClassVar[str] = "Become the owner of an acknowledged alarm whose owner is off duty"
    path: ClassVar[str] = "/api/alarms/{alarm}/take"
    kind: Literal["take_alarm"]
    alarm: Name
    occurrence: Annotated[Number, doc("which occurrence was read; an older one is refused")]


class OfItem(OfCar):
    """Assigns a person to a car that needs one. It arms nothing, and is no control of the car."""

    needs: ClassVar[Needs] = "operator"
    passes_replay: ClassVar[bool] = True  # a page that is offered an item answers
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
    """Offers the car's item to another person; it stays assigned as it is until they accept."""

    http: ClassVar[str] = "Ask another person to take the car's item over"
    path: ClassVar[str] = "/api/attention/offer"
    kind: Literal["offer_item"]
    to: Annotated[PageName, doc("the page of that person, as `people` of the summary names it")]


class AnswerItem(OfItem):
    """Accepts or declines an offered item; only by the person to whom it was offered."""

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
