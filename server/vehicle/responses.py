"""What an operator does about an alarm."""

from __future__ import annotations

from collections.abc import Collection

from monitor.alarm import Transition
from monitor.runner import Monitor
from server.protocol import commands


def respond(
    monitor: Monitor,
    command: commands.Acknowledge | commands.Silence | commands.Shelve | commands.Unshelve,
    now_s: float,
    by: str,
) -> Collection[Transition]:
    """What changed by it. Raises Refused."""
    match command:
        case commands.Acknowledge():
            return monitor.acknowledge(command.alarm, command.occurrence, by=by, now_s=now_s)
        case commands.Silence():
            return monitor.silence(command.alarm, command.occurrence, by=by, now_s=now_s)
        case commands.Shelve():
            return monitor.shelve(command.alarm, command.occurrence, minutes=command.minutes, by=by, now_s=now_s)
        case _:
            return monitor.unshelve(command.alarm, by=by, now_s=now_s)
