"""The `cars` frame: the cars of a server that watches several, each in a few numbers."""

from __future__ import annotations

from typing import Annotated, Literal, NotRequired

from typing_extensions import TypedDict

from monitor.alarm import AlarmState
from monitor.alarm_spec import Priority, Sound
from monitor.planned_stop import StopReason
from monitor.shell_facts import Phase, RecorderState
from server.protocol.doc import doc
from server.protocol.signal_state import SignalFreshness
from server.protocol.slow_down_state import SlowDownPhase
from server.protocol.state import Cut


class CarAlarm(TypedDict):
    """The worst alarm of a car."""

    id: str
    occurrence: int
    title: str
    ended_title: NotRequired[Annotated[str, doc("its title once it is not active; not from older agents")]]
    priority: Priority
    state: AlarmState
    active: bool
    raised_ms: int
    sound: Annotated[Sound, doc("none while it is silenced, or makes none because of a planned stop")]
    text: NotRequired[Annotated[str, doc("value against limit, as text")]]


class Unowned(TypedDict):
    """Alarms that were acknowledged by people whose duty has ended since."""

    count: int
    by: Annotated[str, doc("whose duty ended first")]
    since_ms: Annotated[int, doc("when it ended")]


class CarLink(TypedDict):
    """What the chain of a car is made of, as in LinkState and SessionState."""

    cut: Cut | None
    bridge_age_s: float | None
    car_age_s: float | None
    trying_for_s: float
    connected_for_s: float | None


class CarSpeed(TypedDict):
    value_mps: float | None
    freshness: SignalFreshness
    age_s: float | None
    horizon_s: float | None


class CarPlace(TypedDict):
    """Where a car is by its own GPS, WGS84."""

    lat_deg: float
    lon_deg: float
    heading_rad: Annotated[float | None, doc("counter-clockwise from east")]
    freshness: SignalFreshness
    age_s: float | None


class ItemHolder(TypedDict):
    """Who has the item of a car in the attention queue."""

    name: str
    page: str
    since_ms: int


class ItemOffer(TypedDict):
    """To whom the item is offered; it stays where it is until they accept."""

    by: str
    name: str
    page: str
    since_ms: int


class AttentionItem(TypedDict):
    """Why a car needs a person, and who has it. Its session alone decides."""

    since_ms: Annotated[int, doc("the car needs a person without a break since then")]
    assigned: ItemHolder | None
    offered: ItemOffer | None
    escalates_ms: Annotated[int | None, doc("when it is escalated to the supervisor; null: no timer runs")]
    escalated_ms: Annotated[int | None, doc("when it went on to the supervisor")]
    supervisors: NotRequired[
        Annotated[list[str] | None, doc("who is on duty as such now, 3 at most; null: not known, or by an older agent")]
    ]


class PagePerson(TypedDict):
    """An operator's page that announces the alarms of this car."""

    page: str
    name: str


class AskedControl(TypedDict):
    """An operator who requests control of the car and has no answer yet."""

    page: str
    name: str
    left_s: Annotated[float, doc("until silence grants it")]


class CarSummary(TypedDict):
    """One car, as its session states it. What is not required came later: an older agent does not state it."""

    phase: Phase
    paused: bool
    link: CarLink
    worst: Annotated[CarAlarm | None, doc("unacknowledged before acknowledged, then by priority, then the newest")]
    waiting: Annotated[int, doc("alarms that nobody has acknowledged")]
    unowned: NotRequired[Annotated[Unowned | None, doc("acknowledged alarms without an owner on duty; null: none")]]
    speed: CarSpeed
    holder: Annotated[str | None, doc("name of who is in control; null: nobody")]
    page: Annotated[str | None, doc("the page that is")]
    recording: RecorderState
    recording_for_s: float | None
    slow_down: SlowDownPhase
    time_ms: NotRequired[Annotated[int, doc("when it was made, by the clock that its other times are of")]]
    attention: NotRequired[Annotated[AttentionItem | None, doc("null: it needs nobody")]]
    place: NotRequired[Annotated[CarPlace | None, doc("null: no position was received")]]
    energy_percent: NotRequired[Annotated[float | None, doc("of battery or fuel")]]
    requests: NotRequired[Annotated[list[AskedControl], doc("who requests control, the oldest first, 3 at most")]]
    people: NotRequired[Annotated[list[PagePerson], doc("to whom its item can be handed over, 20 at most")]]
    challenge: NotRequired[Annotated[str, doc("as `challenge` of a state")]]
    planned_stop: NotRequired[Annotated[StopReason | None, doc("why it stands on purpose; null: no planned stop")]]


class OffOnPurpose(TypedDict):
    """A person declared a car off; it holds until the car's agent sends data again."""

    by: str
    since_ms: int


class ListedCar(TypedDict):
    name: str
    age_s: Annotated[float | None, doc("of the summary when this was sent; null: there was none in this run")]
    summary: Annotated[CarSummary | None, doc("null: its session has stopped, and nothing is known of the car now")]
    trouble: NotRequired[Annotated[str | None, doc("which part is silent, as a sentence; null: none")]]
    off: NotRequired[Annotated[OffOnPurpose | None, doc("who declared a silent car off; null: nobody")]]


class Cars(TypedDict):
    """All cars of a server that watches several: twice a second, and at once when the alarms of one change."""

    kind: Literal["cars"]
    time_ms: int
    cars: list[ListedCar]
