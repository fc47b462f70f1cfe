"""What catgraph cannot find out by itself and asks the operator in control: which topic, or which unit."""

from __future__ import annotations

from typing import Annotated, Literal

from typing_extensions import TypedDict

from server.protocol.doc import doc


class Option(TypedDict):
    """One answer to a question."""

    value: Annotated[str, doc("what the command `set` takes for it: a topic, or the name of a unit")]
    label: Annotated[str, doc("as the page shows it")]
    why: Annotated[str, doc("what is known of it; empty: nothing")]


class Question(TypedDict):
    """Asked until it is answered by the command `set`: `topics` of a source, `units` of a unit."""

    signal: str
    kind: Literal["source", "unit"]
    words: Annotated[str, doc("*Two lasers: which looks ahead?*")]
    options: Annotated[list[Option], doc("the most probable first, at most 12")]
    options_count: Annotated[int, doc("how many there are, those left out included")]
