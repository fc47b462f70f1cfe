"""The environment in which a command is run as its user runs it."""

from __future__ import annotations

import os


def users_own() -> dict[str, str]:
    """This process's environment without asyncio's debugging, which complains on stderr about a busy machine."""
    return {name: value for name, value in os.environ.items() if name != "PYTHONASYNCIODEBUG"}
