"""Run by ROS's own Python beside the guard's node: an operator and a controller, who tell in JSON what the car was
told."""

from __future__ import annotations

import json
import sys
import time

import rospy
from geometry_msgs.msg import Twist
from std_msgs.msg import String, UInt32

told: list[tuple[float, float, float]] = []
states: list[tuple[float, dict[str, object]]] = []


def main() -> None:
    rospy.init_node("probe")
    rospy.Subscriber("/catvehicle/cmd_vel", Twist, lambda m: told.append((time.monotonic(), m.linear.x, m.angular.z)))
    rospy.Subscriber("/ocu_guard/state", String, lambda m: states.append((time.monotonic(), json.loads(m.data))))
    controller = rospy.Publisher("/catvehicle/cmd_vel_controller", Twist, queue_size=1)
    heartbeat = rospy.Publisher("/ocu_guard/heartbeat", UInt32, queue_size=1)
    release = rospy.Publisher("/ocu_guard/release", UInt32, queue_size=1)
    speed = rospy.Publisher("/catvehicle/vel", Twist, queue_size=1)
    deadline_s = time.monotonic() + 20
    while min(one.get_num_connections() for one in (controller, heartbeat, release, speed)) == 0 or not states:
        if time.monotonic() > deadline_s:
            sys.exit("the guard's node is not there")
        time.sleep(0.05)

    count = 0

    def go(seconds: float, heart: bool) -> None:
        nonlocal count
        ends_s, step = time.monotonic() + seconds, 0
        while time.monotonic() < ends_s:
            if heart and step % 4 == 0:
                count += 1
                heartbeat.publish(count)
            message = Twist()
            message.linear.x = told[-1][1] if told else 3.0
            speed.publish(message)
            message.linear.x, message.angular.z = 3.0, 0.1
            controller.publish(message)
            step += 1
            time.sleep(0.05)

    go(1.5, heart=True)
    guarded = states[-1][1]["state"]
    stopped_s = time.monotonic()
    go(4.5, heart=False)
    held = states[-1][1]
    go(0.5, heart=True)
    release.publish(int(held["hold"]))  # type: ignore[call-overload]
    go(1.0, heart=True)
    print(
        json.dumps(
            {
                "guarded": guarded,
                "held": held["state"],
                "told": [(at_s - stopped_s, speed_mps, angle_rad) for at_s, speed_mps, angle_rad in told],
                "released": states[-1][1]["state"],
            }
        )
    )


main()
