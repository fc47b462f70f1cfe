"""The marks of a drive or of a recording."""

from __future__ import annotations

from typing import Annotated, Literal, NotRequired

from typing_extensions import TypedDict

from server.protocol.doc import doc

# The fields of a mark, as rows and events of the log have them.
MarkSource = Literal["page", "http", "car"]
MarkId = Annotated[str, doc("the mark's id")]
MarkedMs = Annotated[int, doc("the moment that was marked, by the server's clock")]
MarkText = Annotated[str, doc('text on the moment; "": none')]
HasVoice = Annotated[bool, doc("a voice note belongs to it")]
HasPhoto = Annotated[bool, doc("a photo belongs to it")]
MarkedBy = Annotated[MarkSource, doc("what marked: a page, a program, or the car's own button")]


class DriveMark(TypedDict):
    """One moment that somebody marked."""

    mark: MarkId
    marked_ms: MarkedMs
    category: str | None
    words: MarkText
    voice: HasVoice
    photo: HasPhoto
    source: MarkedBy
    by: str | None
    at_s: NotRequired[Annotated[float, doc("of a recording: since it began")]]
    late: NotRequired[Annotated[bool, doc("of a recording: it came, or was changed, after the recording was complete")]]


class MarkList(TypedDict):
    """Marks, the newest moment last."""

    marks: list[DriveMark]
