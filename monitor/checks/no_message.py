"""Is the link open without any message of the car?"""

from __future__ import annotations

from monitor.check import (
    Action,
    AlarmSpec,
    Check,
    Finding,
    Limits,
    Place,
    Priority,
    Quantity,
    Scope,
    Sound,
    absent,
    fault,
    ok,
    unknown,
)
from monitor.inhibition import GRACE_S
from monitor.snapshot import Snapshot

WITHIN_S = 5.0


def find(snapshot: Snapshot, limits: Limits, was_active: bool) -> Finding:
    link, opened_s = snapshot.link, snapshot.link.opened_s
    if opened_s is None:
        return absent("Not connected", brief="no link")
    heard_s = max((at_s for at_s in (link.last_message_s, snapshot.heard_s) if at_s is not None), default=None)
    if heard_s is not None and heard_s >= opened_s:
        return ok("The car sends messages")
    waited_s = snapshot.now_s - opened_s
    if waited_s < WITHIN_S:
        return unknown("Waiting for the first message", short="waiting")
    return fault(
        f"{link.behind_title} {link.behind_hint or ''}".strip()
        if link.behind_title
        else _cause_text(link.bridge_answers, link.topics_subscribed),
        brief="no message",
        measured=Quantity(label="Waited", value=waited_s, unit="s"),
        causes=("car",),
    )


def _cause_text(bridge_answers: bool, topics: int) -> str:
    spoke = f"0 of {topics} topics sent data within {WITHIN_S:.0f} s."
    if not bridge_answers:
        return f"Connected, but neither the bridge's ROS side nor the car answers. {spoke}"
    if topics == 0:
        return "The bridge answers, but offers no topic that catgraph knows."
    return f"The bridge answers, the car publishes nothing. {spoke}"


CHECKS = (
    Check(
        id="no_message",
        label="First message",
        tile="Link",
        order=120,
        checked_when="Checked once the bridge is connected, after a short wait.",
        alarm=AlarmSpec(
            title="Connected, but no message",
            priority=Priority.WARNING,
            place=Place.DIALOG,
            sound=Sound.MEDIUM,
            needs_ack=False,
            actions=(Action.RECONNECT, Action.EXIT),
            advice="Seen after a restart of roscore: restart rosbridge too.",
            inhibited_by=("link_lost",),
            grace_s=GRACE_S,
        ),
        limits=Limits,
        find=find,
        scope=Scope.LINK,
    ),
)
