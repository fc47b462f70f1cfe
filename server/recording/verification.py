"""The verification of one file, with what the recordings beside it show, for the page and the command.

As a process of its own (`python -m server.recording.verification`, with the path in hex) it prints one line of JSON.
"""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import orjson

from server.recording.chain_neighbours import Beside, Neighbours, compare, destroyed
from server.recording.folder import FINISHED, WRITING
from server.recording.read.read import Recording
from server.recording.verify import OnProgress, Verified, verify


@dataclass(frozen=True, slots=True, kw_only=True)
class Verification:
    """Of one file."""

    path: Path
    file: Verified
    beside: Neighbours = field(default_factory=Neighbours)

    @property
    def is_broken(self) -> bool:
        """Broken, unfinished, or not what a recording beside it names."""
        return self.file.state in ("broken", "unfinished") or bool(self.beside.problems)

    @property
    def short(self) -> str:
        """A short text; never *Intact* where a recording beside it objects."""
        if self.file.state == "intact" and self.beside.problems:
            return "Does not match the recording beside it"
        return self.file.short

    @property
    def sentence(self) -> str:
        """All that is known, in sentences."""
        missing = self.beside.missing.sentence if self.beside.missing is not None else ""
        return " ".join(filter(None, (self.file.sentence, *self.beside.problems, missing)))

    def as_json(self) -> dict[str, Any]:
        """Plain values only; what is unknown is null."""
        file = self.file
        return {
            "state": file.state,
            "is_broken": self.is_broken,
            "short": self.short,
            "sentence": self.sentence,
            "records": file.records,
            "head": file.head,
            "broken": None if file.broken is None else asdict(file.broken),
            "is_recovered": file.is_recovered,
            "previous": file.previous,
            "previous_missing": self.beside.missing is not None,
            "problems": list(self.beside.problems),
        }


def verification(path: Path, beside: Beside | None = None, on_progress: OnProgress = lambda part: None) -> Verification:
    """Verifies a file, and compares it with the recordings beside it: those in its folder, or `beside`. Raises
    nothing."""
    return compared(path, verify(path, on_progress), beside or Beside(path.absolute().parent))


def compared(path: Path, found: Verified, beside: Beside) -> Verification:
    """A file that was verified by itself, compared with the recordings beside it."""
    if found.state == "unreadable":
        return Verification(path=path, file=found, beside=destroyed(path, beside))
    if found.state == "no chain":
        return Verification(path=path, file=found)
    return Verification(path=path, file=found, beside=compare(path, beside))


def of_files(recording: Recording) -> Sequence[Verification]:
    """Of each file of a recording of ours, by itself; empty for recordings of others."""
    paths = [file.path for file in recording.files if file.path.name.endswith((FINISHED, WRITING))]
    found = [Verification(path=path, file=verify(path)) for path in paths]
    return [one for one in found if one.file.state != "unreadable"]


def main() -> None:
    with contextlib.suppress(OSError):
        os.nice(15)
    found = verification(Path(os.fsdecode(bytes.fromhex(sys.argv[1]))))
    sys.stdout.buffer.write(orjson.dumps(found.as_json()) + b"\n")


if __name__ == "__main__":
    main()
