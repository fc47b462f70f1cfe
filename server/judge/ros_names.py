"""Spelling of topic, service and type names as a rosbridge of each ROS version takes them."""

from __future__ import annotations

import re

from server.judge.message import RosVersion

LONGEST_NAME = 255  # letters; a name in ROS is a path of identifiers, and the longest seen in the wild has 90

_IDENTIFIER = re.compile(r"[A-Za-z]\w*", re.ASCII)


class BadName(ValueError):
    """A name that no ROS graph could hold; the text is one sentence for the client."""


def canonical_name(name: str) -> str:
    """`chatter` and `/chatter/` are the topic `/chatter`."""
    path = name.strip("/")
    if not path or len(name) > LONGEST_NAME or not path.isprintable() or " " in path:
        raise BadName(f"{_shown(name)} is not a valid name")
    return f"/{path}"


def canonical_type(name: str, version: RosVersion, kind: str = "msg") -> str:
    """`pkg/Type` in ROS 1, `pkg/msg/Type` in ROS 2. ROS 2 also takes the ROS 1 spelling, not the other way round."""
    parts = [part for part in name.split("/") if part]
    counts = (2,) if version == 1 else (2, 3)
    if len(name) > LONGEST_NAME or len(parts) not in counts or not all(map(_IDENTIFIER.fullmatch, parts)):
        raise BadName(f"{_shown(name)} is not a valid type string in ROS {version}")
    return f"{parts[0]}/{parts[-1]}" if version == 1 else f"{parts[0]}/{kind}/{parts[-1]}"


def _shown(name: str) -> str:
    return repr(name if len(name) <= 60 else name[:60] + "…")
