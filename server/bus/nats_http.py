"""How requests for what agents keep (recordings, mail) travel through a NATS broker: subjects `veh.<vehicle>.http.…`.

| subject | body of the node | answer of the agent |
|---|---|---|
| `begin` | `Begin`, the first part of the request's body | the first chunk of the answer, or `wait` |
| `body` | `Part`, a further part of the request's body | `wait` |
| `pull` | `Pull` | a chunk of the answer, or `wait` where it is not there yet |
| `drop` | `Drop` | none |

Each message is a line of JSON and then bytes, and is far below the broker's largest. An answer is pulled, never pushed:
the node has a few pulls under way, fewer where they take long, so that a download does not delay the frames that share
the connection. What is lost on the way is requested again; a request is carried out once, by its id.
"""

from __future__ import annotations

from typing import Annotated, Literal, TypeVar

from pydantic import Field

from server.bus.nats_wire import Body, Malformed, Number, decode, encode

CHUNK = 48 * 1024  # bytes of a request's or an answer's body in one message
MOST_PARTS = 171  # of a request's body: a photo of 8 MB is the largest
FEW_PARTS = 6  # of all other requests
MOST_AHEAD = 8  # chunks that an agent makes before they are pulled, and that a node has under way
LONGEST_MESSAGE = 128 * 1024
WAITS_S = 1.0  # an agent that has nothing yet answers so after so long
UNASKED_S = 15.0  # an answer that is not pulled for so long is given up

Id = Annotated[str, Field(pattern=r"^[0-9a-f]{32}$")]
Headers = Annotated[
    dict[Annotated[str, Field(max_length=100)], Annotated[str, Field(max_length=4000)]], Field(max_length=30)
]  # each once
B = TypeVar("B", bound=Body)


class Refused(Exception):
    """A request that an agent does not carry out; `str()` is one sentence."""

    def __init__(self, status: int, sentence: str) -> None:
        super().__init__(sentence)
        self.status = status


class Sender(Body):
    """Who sent the request to the node, as authenticated there."""

    id: Annotated[str, Field(max_length=100)]
    name: Annotated[str, Field(max_length=200)] = ""
    role: Annotated[str, Field(max_length=20)] = ""


class Begin(Body):
    """A request without its body, which comes in `parts`; `root_path` is the part before `path` at the node."""

    id: Id
    method: Annotated[str, Field(pattern=r"^[A-Z]{3,10}$")]
    path: Annotated[str, Field(max_length=2000)]
    query: Annotated[str, Field(max_length=8000)] = ""
    root_path: Annotated[str, Field(max_length=200)] = ""
    scheme: Literal["http", "https"] = "http"
    headers: Headers = Field(default_factory=dict)
    sender: Sender
    parts: Annotated[int, Field(ge=1, le=MOST_PARTS)] = 1


class Part(Body):
    """The body from `n * CHUNK` on."""

    id: Id
    n: Annotated[int, Field(ge=1, lt=MOST_PARTS)]


class Pull(Body):
    """Chunk `n` is wanted; those before `have` are at the node."""

    id: Id
    n: Number
    have: Number


class Drop(Body):
    """The answer is not wanted any more."""

    id: Id


class Chunk(Body):
    """`wait`: not yet; `gone`: the agent does not know the request, or its answer broke off; `refused`: see there.

    `status` and `headers` of the answer are in its chunk 0.
    """

    state: Literal["more", "last", "wait", "gone", "refused"]
    status: Annotated[int, Field(ge=0, le=599)] = 0
    headers: Headers = Field(default_factory=dict)
    waited_s: Annotated[float, Field(ge=0.0, le=3600.0)] = 0.0  # for the chunk, at the agent
    refused: Annotated[str, Field(max_length=500)] = ""  # a sentence


def pack(head: Body, payload: bytes = b"") -> bytes:
    """One message."""
    return encode(head) + b"\n" + payload


def unpack(kind: type[B], data: bytes) -> tuple[B, bytes]:
    """Its head and its bytes. Raises Malformed."""
    if len(data) > LONGEST_MESSAGE:
        raise Malformed(f"{len(data)} bytes")
    line, _, payload = data.partition(b"\n")
    if len(payload) > CHUNK:
        raise Malformed(f"{len(payload)} bytes of a body")
    return decode(kind, line), payload
