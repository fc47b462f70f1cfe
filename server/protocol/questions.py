"""What catgraph cannot determine by itself, as questions to the operator in control: which topic, or which unit."""

from __future__ import annotations

from typing import Annotated, Literal, NotRequired

from typing_extensions import TypedDict

from server.protocol.doc import doc


class Option(TypedDict):
    """One answer to a question."""

    value: Annotated[str, doc("what the command `set` takes for it: a topic, or the name of a unit")]
    label: Annotated[str, doc("as the page shows it")]
    why: Annotated[str, doc("what is known of it; empty: nothing")]


class Question(TypedDict):
    """Open until it is answered by the command `set`: `topics` of a source, `units` of a unit."""

    signal: str
    kind: Literal["source", "unit"]
    words: Annotated[str, doc("*Two lasers: which one faces forward?*")]
    options: Annotated[list[Option], doc("the most probable first, at most 12")]
    options_count: Annotated[int, doc("how many there are, those left out included")]


class TopicOffer(TypedDict):
    topic: str
    type: str
    frame: NotRequired[Annotated[str | None, doc("that its messages name; null: none, or not known")]]
    why: NotRequired[Annotated[str, doc("evidence for and against it, as a short text")]]
    ranges_m: NotRequired[
        Annotated[
            list[float | None],
            doc("of a laser that is compared: the nearest range in each of at most 72 parts of its newest scan"),
        ]
    ]
    angle_min_rad: NotRequired[Annotated[float, doc("of the middle of the first part, in the laser's own frame")]]
    angle_increment_rad: NotRequired[Annotated[float, doc("from one part to the next")]]
