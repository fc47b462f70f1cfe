"""Who drives: the mode of a state, interventions, and the totals of the drive."""

from __future__ import annotations

from typing import Annotated, Literal

from typing_extensions import TypedDict

from monitor.interventions import By, KindOf
from monitor.values import Mode
from server.protocol.doc import doc

WhyUnknown = Literal["no_source", "silent", "flickers", "unclear"]


class OpenIntervention(TypedDict):
    """An intervention that nobody has described yet."""

    id: str
    at_ms: int
    kind_of: KindOf


class ModeState(TypedDict):
    """Who drives."""

    mode: Mode
    why: Annotated[WhyUnknown | None, doc("why it is unknown; null: it is known")]
    since_ms: Annotated[int | None, doc("null: nothing was known before, or of a recording")]
    way_m: Annotated[float | None, doc("driven in this mode since then; null: not known")]
    source: Annotated[str, doc('the topic; "commands": by the rule; "": none')]
    open: Annotated[list[OpenIntervention], doc("to be described, the oldest first, at most 20")]


class DriveSample(TypedDict):
    """The car at one moment about an intervention."""

    at_s: Annotated[float, doc("since the intervention; negative: before it")]
    speed_mps: Annotated[float | None, doc("null: not known")]
    brake_percent: Annotated[float | None, doc("null: not known")]


class InterventionAnswer(TypedDict):
    """`GET /api/interventions/{intervention}`."""

    id: str
    at_ms: int
    kind_of: KindOf
    speed_mps: float
    lat_deg: float | None
    lon_deg: float | None
    initiated_by: By
    brake_percent: Annotated[float | None, doc("the most, where the brake was pressed against the command")]
    acted_before_s: Annotated[float | None, doc("brake or wheel so long before the mode changed")]
    active: Annotated[list[str], doc("titles of the alarms that were active, at most 20")]
    last_alarm_ago_s: Annotated[float | None, doc("since the newest alarm before it began; null: none, or not known")]
    samples: Annotated[list[DriveSample], doc("from 10 s before to 6 s after; of before a restart: no later ones")]
    what: Annotated[str | None, doc("as it was described last; null: not yet")]
    category: str | None
    described_by: str | None
    left: Annotated[int, doc("interventions that nobody has described yet")]


class InterventionDescription(TypedDict):
    """A description of an intervention; the newest of each holds."""

    intervention: Annotated[str, doc("its id")]
    described_ms: int
    what: Annotated[str, doc('"": the category is enough')]
    category: str | None
    initiated_by: Annotated[By | None, doc("null: as the data say")]
    by: str | None


class ModeTotal(TypedDict):
    s: float
    m: float


class PerKilometre(TypedDict):
    interventions: Annotated[float | None, doc("on a kilometre driven by itself; null: no such distance")]
    alarms: Annotated[float | None, doc("announced, on a kilometre; null: no distance")]


class DrivingAnswer(TypedDict):
    """`GET /api/driving`: totals since this car was dialled."""

    modes: Annotated[dict[Mode, ModeTotal], doc("time and distance in each mode")]
    interventions: int
    alarms: int
    per_km: PerKilometre
