"""What is known of the recorder; the shell fills it, the checks read it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

# off: nothing is to be recorded; held: the link is lost, and the session goes on when it returns soon; saving: what
# was recorded is being completed; stopped: it was to record and cannot
RecorderState = Literal["off", "recording", "saving", "held", "stopped"]


@dataclass(frozen=True, slots=True, kw_only=True)
class RecorderFacts:
    """The recorder at one moment; times on the clock of `received_s`."""

    state: RecorderState = "off"
    trouble: str | None = None  # why it stopped by itself, as a sentence
    dropped: int = 0  # messages of this session that were not recorded, because the disk was too slow
    dropped_s: float | None = None  # when the newest of them came
    behind_s: float = 0.0  # how long the oldest message waits to be written
    left_gb: float | None = None  # what may still be recorded before a limit stops it; None: not known yet
    limit: str = ""  # which limit that is, in a few words
