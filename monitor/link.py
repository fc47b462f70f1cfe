"""What is known of the link to the vehicle; the shell fills it, the checks read it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import Literal

from monitor.immutable import immutable

Phase = Literal["idle", "connecting", "failed", "monitoring", "lost"]


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
    last_message_s: float | None = None  # when the car last said anything
    published: frozenset[str] = frozenset()  # the signals that discovery found on the car
    carriers: Mapping[str, str] = field(default_factory=dict)  # signal → the topic that carries it
    compared: Mapping[str, tuple[str, ...]] | None = None  # signal → further topics of it; None: not known
    undecided: Mapping[str, str] = field(
        default_factory=dict
    )  # signals that no topic carries yet, and why, in few words
    log_trouble: str | None = None  # why the alarm log is not kept on the disk, as a sentence; None: it is
    late_s: float | None = None  # how late the messages are that come now; None: not known
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
