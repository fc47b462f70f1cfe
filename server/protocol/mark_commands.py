"""Marks: moments of a drive that somebody wants to look at again; server/vehicle/marks.py keeps them."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from server.protocol.command_base import Needs, OfCar
from server.protocol.doc import doc

MARK = r"^[A-Za-z0-9-]{1,40}$"
MarkId = Annotated[str, Field(pattern=MARK, description="its id, made up by who marks; the same again changes it")]


class OfMark(OfCar):
    """Places, changes or removes a mark; control is not needed, nor a car."""

    needs: ClassVar[Needs] = "operator"
    passes_replay: ClassVar[bool] = True  # the live drive is marked, whatever the page shows
    is_signed: ClassVar[bool] = False  # nothing of the car changes by it, and it may have waited on a phone


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
    category: Annotated[str, Field(max_length=40, description='a word or two; "": none any more')] | None = None
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
