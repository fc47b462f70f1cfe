"""A recording that was never closed is not read for its marks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from server.recording.marks.recorded import NOTHING, in_file
from server.recording.mcap import mcap_file
from tests.server.recording.made import record


def test_a_file_that_was_never_closed_is_not_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its index would be made of all of it, while a page waits."""
    path = record(tmp_path / "car" / "a.mcap", seconds=2.0)
    assert in_file(path) != NOTHING
    path.write_bytes(path.read_bytes()[:-8])

    def read(*_: Any) -> None:
        raise AssertionError("it is read")

    monkeypatch.setattr(mcap_file, "McapFile", read)
    with pytest.raises(ValueError, match="never closed"):
        mcap_file.finished(path)
    assert in_file(path) == NOTHING
