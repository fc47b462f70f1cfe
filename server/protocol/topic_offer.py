"""A topic that may carry a signal, as the answer to `GET /api/signals` lists it."""

from __future__ import annotations

from typing import Annotated, NotRequired

from typing_extensions import TypedDict

from server.protocol.doc import doc


class TopicOffer(TypedDict):
    topic: str
    type: str
    frame: NotRequired[Annotated[str | None, doc("that its messages name; null: none, or not known")]]
    why: NotRequired[Annotated[str, doc("evidence for and against it, in few words")]]
    ranges_m: NotRequired[
        Annotated[
            list[float | None],
            doc("of a laser that is compared: the nearest range in each of at most 72 parts of its newest scan"),
        ]
    ]
    angle_min_rad: NotRequired[Annotated[float, doc("of the middle of the first part, in the laser's own frame")]]
    angle_increment_rad: NotRequired[Annotated[float, doc("from one part to the next")]]
