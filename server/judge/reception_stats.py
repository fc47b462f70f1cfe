"""Statistics per topic: messages received, decoded, and rejected with the reason."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

from server.judge.message_fields import NotMeasured, Rejected, has_fields
from server.judge.profiles import Profile
from server.judge.topics import Source
from server.judge.unit_watch import UnitBasis, UnitWatch, read

MAX_REASONS = 20  # a hostile bridge must not fill the memory with reasons
OTHER = "other reasons"


@dataclass(slots=True)
class Tally:
    """The counts of one topic or one signal."""

    received: int = 0  # proper or not
    rejected: int = 0
    repaired: int = 0  # read, but with indulgence
    reasons: Counter[str] = field(default_factory=Counter)
    last_reason: str | None = None
    repaired_why: str | None = None
    not_measured: int = 0  # proper messages that declare the value as not measured
    why_not_measured: str | None = None  # of the newest message without a value; None: that one was rejected
    repeats: int = 0  # of the newest message, that the bridge sent again after a renewed subscription

    def reject(self, reason: str) -> None:
        self.rejected += 1
        self.why_not_measured = None
        key = reason if reason in self.reasons or len(self.reasons) < MAX_REASONS else OTHER
        self.reasons[key] += 1
        self.last_reason = reason


@dataclass(slots=True)
class Reception:
    """All tallies of one vehicle since it was connected."""

    by_signal: dict[str, Tally] = field(default_factory=dict)
    frames: Tally = field(default_factory=Tally)  # what was no message at all
    received: int = 0
    rejected: int = 0
    unasked: int = 0  # messages on topics without a subscription
    repeats: int = 0  # messages that the bridge sent again, of all topics
    frame_ids: dict[str, str] = field(default_factory=dict)  # topic → frame that its newest message names
    units: UnitWatch = field(default_factory=UnitWatch)

    def tally(self, signal: str) -> Tally:
        found = self.by_signal.get(signal)
        if found is None:
            found = self.by_signal[signal] = Tally()
        return found

    def note_frame(self, topic: str, message: Any) -> None:
        """Keep the frame that the header of a message names, at most its first 100 characters."""
        header = message.get("header") if has_fields(message) else None
        if header is None or not has_fields(header):
            return
        frame_id = header.get("frame_id")
        if frame_id != self.frame_ids.get(topic) and isinstance(frame_id, str):
            self.frame_ids[topic] = frame_id[:100]

    def frame_of(self, topic: str) -> str | None:
        """The frame that the newest message of a topic names; None: none, or not known."""
        return self.frame_ids.get(topic) or None

    def read(self, source: Source, message: Any, note: str | None) -> Any | None:
        """The decoded value, or None where it was rejected or is not measured; all are counted."""
        tally = self.by_signal.get(source.signal) or self.tally(source.signal)
        tally.received += 1
        tally.repeats = 0
        if note is not None:
            tally.repaired += 1
            tally.repaired_why = note
        if source.decode is None:
            tally.reject(source.note or "of a type that cannot be read")
            return None
        try:
            return source.decode(message)
        except NotMeasured as why:
            tally.not_measured += 1
            tally.why_not_measured = str(why)
        except Rejected as why:
            tally.reject(str(why))
        except (KeyError, TypeError, ValueError, OverflowError, AttributeError, IndexError) as error:
            # a decoder of ours did not foresee this shape: the message is refused all the same, and the shape is named
            tally.reject(f"unexpected shape: {type(error).__name__}")
        return None

    def read_other(self, source: Source, message: Any, at_s: float, profile: Profile) -> Any | None:
        """The value of a source that is only compared, in the unit of its signal; None where it has none, or its unit
        is not known. No signal counts it. The operator's choice of a unit is that of the topic that carries the
        signal."""
        value = read(source, message)
        try:
            return None if value is None else self.units.convert(source, value, at_s, UnitBasis(profile, {}))
        except Rejected:  # NotMeasured is one
            return None

    def in_unit(self, source: Source, value: Any, at_s: float, basis: UnitBasis) -> Any | None:
        """A value that was read, in the unit of its signal; None where that is not known, which is counted as not
        measured, or where its unit does not allow it."""
        try:
            return self.units.convert(source, value, at_s, basis)
        except NotMeasured as why:
            tally = self.tally(source.signal)
            tally.not_measured += 1
            tally.why_not_measured = str(why)
        except Rejected as why:
            self.tally(source.signal).reject(str(why))
        return None

    def junk(self, reason: str) -> None:
        self.frames.received += 1
        self.frames.reject(reason)
