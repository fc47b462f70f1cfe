"""How a real bridge was started."""

from __future__ import annotations

import fnmatch
from dataclasses import dataclass

BOUND_BYTES = 64_000_000  # where the real one takes anything


@dataclass(frozen=True, slots=True, kw_only=True)
class RealOptions:
    """The parameters of its launch file that a client can notice. Empty globs let everything through."""

    topics_glob: tuple[str, ...] = ()
    services_glob: tuple[str, ...] = ()  # /rosapi/* is always let through
    rosapi_topics_glob: tuple[str, ...] = ()
    rosapi_services_glob: tuple[str, ...] = ()
    rosapi_params_glob: tuple[str, ...] = ()
    authenticate: bool = False  # ROS 1 only; without a rosauth node every login fails
    max_message_bytes: int | None = None  # None: no limit in ROS 1, 10 MB in ROS 2


def is_open(name: str, globs: tuple[str, ...]) -> bool:
    """Whether a client may use what is so named."""
    return not globs or any(fnmatch.fnmatch(name, glob) for glob in globs)
