"""Facts from the server that the checks read: the link, the recorder, whom an alarm reaches, an order to slow."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from monitor.immutable import immutable

Phase = Literal["idle", "connecting", "failed", "monitoring", "lost"]

# off: nothing is to be recorded; held: the link is lost, and the session continues if it returns soon; saving: what
# was recorded is being completed; stopped: it was to record and cannot
RecorderState = Literal["off", "recording", "saving", "held", "stopped"]


@immutable
class LinkFacts:
    """The link at one moment; all times on the clock of `received_s`."""

    phase: Phase = "idle"  # failed: never reached yet; lost: was open, is not; in both it keeps trying
    since_s: float = 0.0  # when this phase began
    attempts: int = 0
    bridge_heard_s: float | None = None  # when the bridge last proved to be alive (pong, service answer, message)
    bridge_answers: bool = False  # its ROS side answers (get_time)
    problem_title: str | None = None  # one sentence
    problem_hint: str | None = None  # what to do
    behind_title: str | None = None  # the part that failed behind the open bridge, as a sentence; None: none known
    behind_hint: str | None = None
    behind_mark: str | None = None  # a short text
    topics_subscribed: int = 0
    connected_s: float | None = None  # when the open connection was made
    last_message_s: float | None = None  # when the newest message of the car came
    published: frozenset[str] = frozenset()  # the signals that discovery found on the car
    carriers: Mapping[str, str] = field(default_factory=dict)  # signal → the topic that carries it
    compared: Mapping[str, tuple[str, ...]] | None = None  # signal → further topics of it; None: not known
    undecided: Mapping[str, str] = field(default_factory=dict)  # signals that no topic carries yet, and why, in short
    log_trouble: str | None = None  # why the alarm log is not kept on the disk, as a sentence; None: it is
    late_s: float | None = None  # how late the messages are that come now, estimated; None: not known
    most_late_s: float | None = None  # how late they are at most
    throttled: frozenset[str] = frozenset()  # the signals that are throttled because the link is too slow
    reduced: str | None = None  # the throttling, as a sentence; None: none
    wall_zero_s: float | None = None  # the time of day [s since 1970] when `received_s` was 0; None: not known

    def offers(self, signal: str) -> bool:
        """Whether the car has a signal, or topics for it of which none is chosen."""
        return signal in self.published or signal in self.undecided

    @property
    def opened_s(self) -> float | None:
        """When the link that is open now was opened, the last time if it was lost meanwhile; None while closed."""
        if self.phase != "monitoring":
            return None
        return self.since_s if self.connected_s is None else max(self.since_s, self.connected_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class RecorderFacts:
    """The recorder at one moment; times on the clock of `received_s`."""

    state: RecorderState = "off"
    trouble: str | None = None  # why it stopped by itself, as a sentence
    dropped: int = 0  # messages of this session that were not recorded, because the disk was too slow
    dropped_s: float | None = None  # when the newest of them came
    behind_s: float = 0.0  # how long the oldest message waits to be written
    left_gb: float | None = None  # what may still be recorded before a limit stops it; None: not known yet
    limit: str = ""  # which limit that is, in short


@dataclass(frozen=True, slots=True, kw_only=True)
class ReachFacts:
    """The number of operators that can hear alarms now."""

    can: int = 0  # operators who have a phone that would sound an alarm now
    of: int = 0  # operators whose phones are known
    why: str = ""  # why the others cannot, in short; "": no operator, or all can


@dataclass(frozen=True, slots=True, kw_only=True)
class SlowingFacts:
    """The order at one moment; times on the clock of `received_s`."""

    is_armed: bool = False
    topic: str = ""  # where commands go
    rivals: tuple[str, ...] = ()  # who else publishes there, by the names of their nodes
    ordered_s: float | None = None  # time of the active order; None: none is active
    sending_s: float | None = None  # since when its commands go out without a gap; None: they do not
    deceleration_mps2: float = 0.0
    commanded_mps: float | None = None  # the newest command
    ended_at_longest_s: float | None = None  # when an order ended because it stood as long as is allowed
