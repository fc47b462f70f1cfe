"""The `control`, `reach`, `phone` and `phones` of a state: operators, whom an alarm reaches, where phones are."""

from __future__ import annotations

from typing import Annotated, Literal, NotRequired

from typing_extensions import TypedDict

from monitor.alarm_spec import Priority
from monitor.phones import Why
from server.protocol.doc import doc

Ready = Literal["ready", "refused", "asks", "missing", "interrupted"]
LineKind = Literal["alarm", "shelved", "limit", "rides", "driving", "departure", "slow_down", "paused", "planned_stop"]
ReaderEnded = Literal["silent", "blind", "hidden", "undrawn", "sound", "replay"]


class FormerHolder(TypedDict):
    name: str
    page: str
    may_return_s: float


class ControlRequest(TypedDict):
    page: str
    name: str
    left_s: Annotated[float, doc("until silence grants it")]


class HandoverLine(TypedDict):
    """One thing that stands, to be read back."""

    key: str
    kind: LineKind
    title: str
    text: str
    priority: Annotated[Priority | None, doc("of an alarm")]
    since_ms: int | None
    off_duty_ms: NotRequired[
        Annotated[
            int | None, doc("of an acknowledged alarm: when the duty of its owner ended; null: on duty, or not known")
        ]
    ]
    until_ms: Annotated[int | None, doc("of what is shelved")]
    read: Annotated[bool, doc("who takes over has confirmed it")]


class HandoverState(TypedDict):
    """Control is being handed over: it changes once every line is read back."""

    by: str
    by_page: str
    name: Annotated[str, doc("who takes over")]
    page: str
    since_ms: int
    lines: list[HandoverLine]
    left: Annotated[int, doc("lines that are not confirmed")]
    version: Annotated[str, doc("of the list")]


class ControlState(TypedDict):
    """Who is in control."""

    holder: Annotated[str | None, doc("name of who is in control; null: nobody")]
    page: NotRequired[Annotated[str | None, doc("the page that is")]]
    fence: NotRequired[Annotated[int | None, doc("number of its lease")]]
    since_ms: NotRequired[int | None]
    renewed_s: NotRequired[Annotated[float | None, doc("since the lease was renewed")]]
    lapses_s: NotRequired[Annotated[float, doc("after so long without renewal it lapses")]]
    former: NotRequired[Annotated[FormerHolder | None, doc("whose lease lapsed, and who can reclaim it until then")]]
    requests: NotRequired[Annotated[list[ControlRequest], doc("who requests control, the oldest first")]]
    handover: NotRequired[Annotated[HandoverState | None, doc("null: control is not being handed over")]]


class PagePresence(TypedDict):
    """One page of an operator."""

    page: str
    name: str
    can: Annotated[bool, doc("an alarm would be audible on it now")]
    why: Annotated[
        ReaderEnded | None,
        doc("silent: no contact for 3 s; blind: it receives nothing for 2 s; undrawn: its drawing failed"),
    ]
    why_text: str | None
    here: Annotated[bool, doc("it is seen now, so that control can be handed to it")]
    awake: Ready
    vibrates: bool
    battery: float | None
    charging: bool | None
    heard_s: float | None


class ReachState(TypedDict):
    """On the pages of how many operators an alarm would sound now."""

    can: int
    of: int
    why: Annotated[str, doc("why the others would not")]
    pages: Annotated[list[PagePresence], doc("at most 12; a page silent for 5 min is forgotten")]
    left_out: int


class OperatorsState(TypedDict):
    control: ControlState
    reach: Annotated[ReachState | None, doc("null: of a recording")]


class PhonePlace(TypedDict):
    """Where a phone is, or why that is not known."""

    id: str
    label: str | None
    handheld: bool
    chosen: Annotated[bool, doc("the operator in control chose it as the one in the car")]
    lat_deg: Annotated[float | None, doc("its newest fix, WGS84; null before there is one")]
    lon_deg: float | None
    accuracy_m: float | None
    sigma_m: float | None
    alt_m: float | None
    speed_mps: float | None
    heading_deg: float | None
    at_ms: Annotated[float | None, doc("by the phone's own clock: to be shown only")]
    age_s: Annotated[float | None, doc("since it was measured")]
    used: Annotated[bool, doc("it can be compared with the car")]
    why: Annotated[
        Why | None,
        doc("why it is not used. coarse: worse than 50 m; old: 5 s; late: came slowly; silent: 5 s; off: it left"),
    ]
    why_text: str | None


class PhoneListed(PhonePlace):
    compared: Annotated[bool, doc("with the car")]


class PhoneCompared(PhonePlace):
    """The phone that is compared with the car."""

    count: Annotated[int, doc("how many phones share their position")]
    choice: Annotated[
        Literal["operator", "only", "first", "none"],
        doc("why it is this one. first: with a usable position; none: none has one"),
    ]
    choice_text: str
    apart_m: Annotated[float | None, doc("the newest comparison: the distance")]
    bearing_deg: Annotated[float | None, doc("of the car from the phone: 0 north, clockwise")]
    compared_age_s: Annotated[float | None, doc("since the moment that was compared, which is the phone's")]
    explained_m: Annotated[float | None, doc("what the errors of both explain")]
    correlation: Annotated[float | None, doc("of the tracks of the last minute; null: one of them did not move")]
