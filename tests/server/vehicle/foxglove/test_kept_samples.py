"""A source that cannot subscribe once more: nothing that was published is lost for what a publisher may keep."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.server.vehicle.keeping_bridge import KeepingBridge, Topic, monitored
from tests.world.test_kept_samples import FUEL, drive, recorded, topics

pytestmark = pytest.mark.virtual_time
SWITCH = "/lights"  # only recorded


class OneSubscription(KeepingBridge):
    def again(self, topic: str) -> bool:
        return False


async def test_an_equal_message_after_a_renewal_is_recorded(tmp_path: Path) -> None:
    types = {SWITCH: "std_msgs/Bool", FUEL: "std_msgs/Float32"}
    bridge = OneSubscription(topics() | {topic: Topic(type) for topic, type in types.items()})
    async with monitored(bridge, tmp_path):
        await drive(bridge, 4.0, hz=4.0)
        for topic, message in ((SWITCH, {"data": True}), (FUEL, {"data": 60.0})):
            bridge.publish(topic, message)
            await drive(bridge, 3.0, hz=4.0)
            bridge.renew(topic)
            await drive(bridge, 0.25, hz=4.0)
            bridge.publish(topic, message)
            await drive(bridge, 1.0, hz=4.0)
    assert recorded(tmp_path, SWITCH) == [[True, True]]
    assert recorded(tmp_path, FUEL) == [[60.0, 60.0]]
