"""What is advertised to a car begins and ends topic by topic."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from server.rosbridge.live_source import LinkDown
from server.rosbridge.outgoing import NotAllowed
from server.slowdown.command_target import CommandTarget
from server.slowdown.publisher import CommandPublisher
from server.slowdown.sender import Sender


@pytest.mark.parametrize(("error", "ended"), [(NotAllowed("no"), ["/a", "/b"]), (LinkDown("no"), ["/a"])])
def test_a_topic_that_cannot_be_ended_keeps_no_other_one(error: Exception, ended: list[str]) -> None:
    sent: list[dict[str, Any]] = []

    def send_now(operation: dict[str, Any]) -> None:
        sent.append(operation)
        if operation["op"] == "unadvertise" and operation["topic"] == "/a":
            raise error

    publisher = CommandPublisher()
    publisher.attach(SimpleNamespace(is_open=True, send_now=send_now))  # type: ignore[arg-type]
    for topic in ("/a", "/b"):
        publisher.advertise(topic, "geometry_msgs/Twist")
    publisher.unadvertise_all()
    assert [one["topic"] for one in sent if one["op"] == "unadvertise"] == ended
    publisher.unadvertise_all()
    assert len([one for one in sent if one["op"] == "unadvertise" and one["topic"] == "/a"]) == 1


@pytest.mark.parametrize("error", [NotAllowed("no"), LinkDown("its channels are not listed yet")])
def test_a_topic_that_cannot_be_announced_yet_is_announced_with_the_first_command(error: Exception) -> None:
    sent: list[dict[str, Any]] = []
    errors = [error]

    def send_now(operation: dict[str, Any]) -> None:
        if errors:
            raise errors.pop()
        sent.append(operation)

    nothing = cast("Any", SimpleNamespace(order=None))
    sender = Sender(nothing, nothing, nothing, now=lambda: 0.0, wall_ms=lambda: 0, record=lambda row: None)
    sender.attach(SimpleNamespace(is_open=True, send_now=send_now))  # type: ignore[arg-type]
    sender.target = CommandTarget(topic="/cmd", type="geometry_msgs/Twist")
    sender.announce()
    assert sent == []
    sender.publisher.publish("/cmd", "geometry_msgs/Twist", {})
    assert [one["op"] for one in sent] == ["advertise", "publish"]
