"""The `decelerate` of a state: the slow-down."""

from __future__ import annotations

from typing import Annotated, Literal, NotRequired

from typing_extensions import TypedDict

from server.protocol.doc import doc

SlowDownPhase = Literal["not_available", "not_armed", "armed", "ordered", "holding"]
FORMER_PHASES: dict[str, SlowDownPhase] = {"safe": "not_armed"}  # as older agents state them, and older pages know them
GuardPhase = Literal["unguarded", "guarded", "operator", "slowing", "holding"]


class OrderSteps(TypedDict):
    """When; null: not (yet)."""

    pressed_ms: int | None
    server_ms: int | None
    bridge_ms: int | None
    slows_ms: int | None


class SlowDownOrder(TypedDict):
    """The active order."""

    number: int
    by: str
    why: Annotated[str, doc('"by hand", or the title of the rule that ordered it')]
    for_s: float
    from_mps: float | None
    ordered_mps: float | None
    deceleration_mps2: float
    sending: Annotated[
        bool, doc("false: its commands are not sent; it continues when the link is back, if it is not released")
    ]
    confirmed: Annotated[
        bool | None,
        doc("by a change of the car's own speed; null: not known; false: not confirmed, use the physical stop"),
    ]
    stands: Annotated[
        Literal["before", "unproven"] | None,
        doc("before: the car stood when it was ordered; unproven: it stands, and its speed does not show why"),
    ]
    steps: OrderSteps
    longest_s: float


class Countdown(TypedDict):
    """A slow-down that begins by itself, unless it is vetoed."""

    trigger: str
    title: str
    text: str
    left_s: float


class GuardState(TypedDict):
    """The guard on the car."""

    state: GuardPhase
    why: str
    hold: int
    age_s: float


class SlowDownSummary(TypedDict):
    """The state of a session without its countdown and guard."""

    state: Annotated[SlowDownPhase, doc("ordered: on its ramp; holding: zeros are held")]
    why: Annotated[str | None, doc("why it is not available, as a sentence")]
    topic: NotRequired[str | None]
    type: NotRequired[str | None]
    rivals: NotRequired[Annotated[list[str] | None, doc("who else publishes there; null: not known")]]
    armed_by: NotRequired[str | None]
    deceleration_mps2: NotRequired[Annotated[float, doc("that will be ordered")]]
    order: NotRequired[SlowDownOrder | None]


class SlowDownState(SlowDownSummary):
    countdown: NotRequired[Countdown | None]
    guard: NotRequired[Annotated[GuardState | None, doc("null: no guard on the car, link loss will NOT slow it")]]
