"""Sets a file aside under a free name, so that nothing that cannot be read is ever overwritten."""

from __future__ import annotations

import os
from pathlib import Path

_MOST = 1000


def free_name(path: Path, word: str = "unusable") -> Path:
    """`settings.toml` → `settings.unusable.toml`, then `settings.unusable-2.toml`, the first that does not exist."""
    first = path.with_name(f"{path.stem}.{word}{path.suffix}")
    others = (path.with_name(f"{path.stem}.{word}-{number}{path.suffix}") for number in range(2, _MOST))
    for name in (first, *others):
        if not os.path.lexists(name):
            return name
    raise FileExistsError(17, f"{_MOST} files beside {path.name} are set aside already")


def set_aside(path: Path, word: str = "unusable") -> Path:
    """Renames the file; its new name. Raises OSError: the file is where it was then."""
    aside = free_name(path, word)
    os.rename(path, aside)
    return aside
