"""A small JSON file that only the server's own user may read (mode 0600), replaced whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import orjson

from server.storage import durable_file

_MOST_BYTES = 1024 * 1024


def read(path: Path) -> Any:
    """The content of the file; None: there is none. A mode that others could read is corrected.

    Raises OSError if it cannot be read, ValueError if it is not JSON or far too large.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW)
    except FileNotFoundError:
        return None
    with os.fdopen(descriptor, "rb") as file:
        status = os.fstat(file.fileno())
        if status.st_mode & 0o077:
            os.fchmod(file.fileno(), 0o600)
        if status.st_size > _MOST_BYTES:
            raise ValueError(f"{path.name} is larger than it ever is")
        return orjson.loads(file.read())


def write(path: Path, content: Any) -> None:
    """Write the file atomically: after a power loss it has the old or the new content. Raises OSError."""
    folder(path.parent)
    durable_file.write(path, orjson.dumps(content, option=orjson.OPT_INDENT_2), mode=0o600)


def folder(path: Path) -> None:
    """Makes it, for the server's own user only."""
    path.mkdir(parents=True, exist_ok=True, mode=0o700)
