"""The `recording` of a state: what is being recorded, and what is not."""

from __future__ import annotations

from typing import Annotated, NotRequired

from typing_extensions import TypedDict

from monitor.shell_facts import RecorderState
from server.protocol.doc import doc


class TooLarge(TypedDict):
    topic: str
    mb: float


class SavedFile(TypedDict):
    name: str
    until_ms: int


class MissingTopics(TypedDict):
    """Topics that are not, or not wholly, recorded."""

    left_out_count: NotRequired[int]
    not_received_count: NotRequired[int]
    too_large_count: NotRequired[int]
    left_out: NotRequired[
        Annotated[list[str], doc("not recorded: bulky, too many, or with messages that are too large; at most 20")]
    ]
    not_received: NotRequired[
        Annotated[list[str], doc("have a publisher, and no message comes, as CBOR or as JSON; at most 20")]
    ]
    too_large: NotRequired[Annotated[list[TooLarge], doc("left after two messages of more than 16 MB; at most 20")]]


class RecordingState(MissingTopics):
    """The recording; a replay's has `state` and `for_s` only."""

    state: Annotated[
        RecorderState,
        doc(
            "saving: being completed; held: link lost, it continues if that returns in time; "
            "stopped: it was to record and cannot"
        ),
    ]
    for_s: float | None
    name: NotRequired[
        Annotated[str | None, doc("of the file that is written, or the last of this session; part 2 is named …_p2")]
    ]
    part: NotRequired[int | None]
    bytes: NotRequired[int]
    messages: NotRequired[Annotated[int, doc("of the car, in this part")]]
    as_json: NotRequired[
        Annotated[int, doc("of them, kept as JSON: not of their type, or of a type whose definition is not known")]
    ]
    dropped: NotRequired[Annotated[int, doc("of this session, not recorded because the disk was too slow")]]
    room_gb: NotRequired[Annotated[float | None, doc("what may still be recorded before a limit stops it")]]
    saved: NotRequired[Annotated[SavedFile | None, doc("the newest finished file; null: none in this run")]]
    reason: NotRequired[Annotated[str | None, doc("why it does not record, as a sentence")]]
