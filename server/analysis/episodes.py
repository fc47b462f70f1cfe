"""Turns the transitions of a run into episodes: one for each time that an alarm was active."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from monitor.alarm import Alarm, Transition
from monitor.alarm_spec import Priority
from monitor.check import Finding


@dataclass(frozen=True, slots=True, kw_only=True)
class Announcement:
    """One announcement to the operator."""

    at_s: float
    text: str
    change: str  # raised, recaused or unshelved


@dataclass(frozen=True, slots=True, kw_only=True)
class Episode:
    """An alarm from its raising to its clearing. Times are seconds since the beginning of the recording."""

    alarm_id: str
    title: str
    priority: Priority
    raised_s: float
    cleared_s: float | None  # None: it stood at the end
    until_s: float  # cleared, or the end of what was judged
    trip_text: str  # text of the check when it raised
    worst: Finding | None  # furthest beyond its limit, where it measures against one
    causes: tuple[str, ...] = ()
    advice: str = ""
    announcements: tuple[Announcement, ...] = ()
    suppressed: tuple[tuple[float, float], ...] = ()  # from, to: explained by another alarm meanwhile

    @property
    def for_s(self) -> float:
        return self.until_s - self.raised_s

    @property
    def worst_text(self) -> str:
        """The text of the check at the worst moment, if it differs from the first one; else empty."""
        return self.worst.text if self.worst is not None and self.worst.text != self.trip_text else ""


class Diary:
    """Follows the alarms of one run."""

    def __init__(self) -> None:
        self.transitions: list[Transition] = []
        self._open: dict[str, Episode] = {}
        self._hidden_since_s: dict[str, float] = {}
        self._closed: list[Episode] = []

    def note(self, transitions: Sequence[Transition], alarms: dict[str, Alarm]) -> None:
        """Take the transitions of one judgement; `alarms` are all alarms after it."""
        for transition in transitions:
            self.transitions.append(transition)
            self._note(transition, alarms[transition.alarm_id])

    def episodes(self, alarms: dict[str, Alarm], end_s: float) -> tuple[Episode, ...]:
        """All episodes in the order of their raising, with those still active at `end_s`, the end of the run."""
        standing = [
            replace(self._with_worst(episode, alarms[alarm_id], end_s), until_s=end_s)
            for alarm_id, episode in self._open.items()
        ]
        return tuple(sorted((*self._closed, *standing), key=lambda e: (e.raised_s, e.priority.rank, e.alarm_id)))

    def _note(self, transition: Transition, alarm: Alarm) -> None:
        alarm_id, at_s = transition.alarm_id, transition.at_s
        announcement = Announcement(at_s=at_s, text=transition.text, change=transition.change)
        episode = self._open.get(alarm_id)
        match transition.change:
            case "raised":
                self._open[alarm_id] = Episode(
                    alarm_id=alarm_id,
                    title=alarm.spec.title,
                    priority=alarm.spec.priority,
                    raised_s=at_s,
                    cleared_s=None,
                    until_s=at_s,
                    trip_text=transition.text,
                    worst=alarm.worst,
                    causes=() if alarm.trip is None else alarm.trip.causes,
                    advice=alarm.spec.advice,
                    announcements=(announcement,),
                )
            case "cleared" if episode is not None:
                done = self._with_worst(self._open.pop(alarm_id), alarm, at_s)
                self._closed.append(replace(done, cleared_s=at_s, until_s=at_s))
            case "suppressed" if episode is not None:
                self._hidden_since_s[alarm_id] = at_s
            case "unsuppressed" if episode is not None:
                self._open[alarm_id] = self._shown_again(episode, at_s)
            case _ if episode is not None and transition.announces:
                causes = () if alarm.trip is None else alarm.trip.causes
                self._open[alarm_id] = replace(
                    episode,
                    announcements=(*episode.announcements, announcement),
                    causes=tuple(dict.fromkeys((*episode.causes, *causes))),
                )

    def _with_worst(self, episode: Episode, alarm: Alarm, at_s: float) -> Episode:
        return replace(self._shown_again(episode, at_s), worst=alarm.worst or episode.worst)

    def _shown_again(self, episode: Episode, at_s: float) -> Episode:
        since_s = self._hidden_since_s.pop(episode.alarm_id, None)
        return episode if since_s is None else replace(episode, suppressed=(*episode.suppressed, (since_s, at_s)))
