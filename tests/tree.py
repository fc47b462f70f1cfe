"""Where things lie: the project's own files, for the tests that look at all of them, and the real drives."""

from __future__ import annotations

import os
import subprocess
from functools import cache
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[1]
RECORDINGS = Path(
    os.environ.get("CATGRAPH_DATA") or PROJECT.parent / "shared" / "data"
)  # real drives, where there are any


@cache
def project_files() -> tuple[Path, ...]:
    """Every file that git tracks or would track, relative to the project's root."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=PROJECT,
        capture_output=True,
        text=True,
        check=True,
    )
    paths = (Path(name) for name in listed.stdout.split("\0") if name)
    return tuple(path for path in paths if (PROJECT / path).is_file())


def text_of(path: Path) -> str | None:
    """The text of one of them, None for a picture or a font."""
    try:
        return (PROJECT / path).read_text(encoding="utf-8")
    except UnicodeDecodeError:
        return None
