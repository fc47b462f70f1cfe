"""What the server sends to one page besides frames and events: replies, problems, the end of a replay."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, TypedDict, cast


class Reply(TypedDict):
    """The answer to one command; more keys depend on the command (docs/protocol.md)."""

    kind: Literal["reply"]
    id: str  # of the command
    ok: bool


class Problem(TypedDict):
    """A message of the page that could not be understood or was too much; it has no id."""

    kind: Literal["problem"]
    reason: str


class ReplayEnded(TypedDict):
    """The page's replay is over without its order."""

    kind: Literal["replay"]
    ended: str


ToPage = Reply | Problem | ReplayEnded


def reply(identity: str, answer: Mapping[str, Any]) -> Reply:
    """An answer in its envelope. No key of the answer replaces one of the envelope."""
    return cast(Reply, {**answer, "ok": answer.get("ok") is True, "kind": "reply", "id": identity})


def refusal(identity: str, reason: str) -> Reply:
    """A command that is refused, with why as a sentence."""
    return reply(identity, {"ok": False, "reason": reason})


def problem(reason: str) -> Problem:
    return {"kind": "problem", "reason": reason}


def replay_ended(reason: str) -> ReplayEnded:
    return {"kind": "replay", "ended": reason}
