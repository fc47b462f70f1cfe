"""Handing control over with read-back; server/control/handover.py has the rules."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from server.protocol.command_base import Needs, OfCar, PageName, Prompt
from server.protocol.doc import doc

LineKey = Annotated[str, Field(min_length=1, max_length=200)]
Version = Annotated[str, Field(min_length=1, max_length=40)]


class OfHandover(OfCar):
    """Part of a hand-over of control; only pages send it."""

    needs: ClassVar[Needs] = "operator"
    passes_replay: ClassVar[bool] = True  # a page that is asked to take over answers


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
