"""The declaration of an alarm: text, place, sound and delays."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Priority(StrEnum):
    CRITICAL = "critical"
    WARNING = "warning"
    ADVISORY = "advisory"

    @property
    def rank(self) -> int:
        """0 is the most urgent."""
        return _RANK[self]


def priority_of(name: object) -> Priority:
    """Return the priority by its name; a name unknown to this version counts as the most urgent."""
    try:
        return Priority(str(name))
    except ValueError:
        return Priority.CRITICAL


_RANK = {Priority.CRITICAL: 0, Priority.WARNING: 1, Priority.ADVISORY: 2}


class Place(StrEnum):
    DIALOG = "dialog"
    SNACKBAR = "snackbar"
    LIST = "list"


class Sound(StrEnum):
    """In the manner of IEC 60601-1-8: bursts of 10, 3 and 2 pulses."""

    HIGH = "high"
    MEDIUM = "medium"
    LOW = "low"
    NONE = "none"


class Action(StrEnum):
    """What the operator can do about it, as buttons."""

    ACKNOWLEDGE = "acknowledge"
    SHELVE = "shelve"
    UNSHELVE = "unshelve"  # of every shelved one; no declaration names it
    DECELERATE = "decelerate"
    RECONNECT = "reconnect"
    CHANGE_ADDRESS = "change_address"
    EXIT = "exit"


@dataclass(frozen=True, slots=True, kw_only=True)
class AlarmSpec:
    """The declaration of one alarm."""

    title: str
    priority: Priority
    place: Place
    sound: Sound
    needs_ack: bool  # stays until acknowledged although its condition has gone
    on_delay_s: float = 0.0  # must hold this long to raise
    off_delay_s: float = 0.0  # must be gone this long to clear
    actions: tuple[Action, ...] = (Action.ACKNOWLEDGE,)
    advice: str = ""  # one sentence: what the operator should do
    inhibited_by: tuple[str, ...] = ()  # alarms which explain this one: while they stand it is not announced
    grace_s: float = 0.0  # once this alarm's condition has gone, what it explains has this long to end too
    repeat_after_s: float = 0.0  # an intermittent alarm is not announced again within this time
    latches: bool = False  # stays active until acknowledged although its condition has gone
    ended: str = ""  # its title once its condition has gone; "": the title and "ended"
    place_after: Place | None = None  # where it shows once its condition has gone; None: where it was

    @property
    def ended_title(self) -> str:
        return self.ended or f"{self.title}: ended"

    @property
    def shelvable(self) -> bool:
        """Whether this priority may be hidden for a time; an alarm that inhibits others never is (see the runner)."""
        return self.priority is not Priority.CRITICAL
