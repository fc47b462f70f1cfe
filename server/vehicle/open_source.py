"""Opens the source of a car's messages that its address names."""

from __future__ import annotations

from collections.abc import Callable

from server.rosbridge.address import Address
from server.rosbridge.link import RosLink
from server.rosbridge.link_listener import LinkListener, Marks
from server.rosbridge.live_source import LiveSource
from server.rosbridge.raw_frame import RawFrame
from server.vehicle.foxglove.source import FoxgloveSource


def open_source(
    address: Address,
    listener: LinkListener,
    *,
    now: Callable[[], float],
    take_unparsed: Callable[[RawFrame], bool] = lambda _: False,
    marks: Marks | None = None,
) -> LiveSource:
    """The `OpenSource` of a session."""
    if address.is_foxglove:
        return FoxgloveSource(address, listener, now=now, take_unparsed=take_unparsed, marks=marks)
    return RosLink(address, listener, now=now, take_unparsed=take_unparsed, marks=marks)
