"""The guard as a ROS 1 node (Noetic): reads topics, ticks, publishes; decides nothing."""

from __future__ import annotations

import json
import threading
import time

import rospy
from geometry_msgs.msg import Twist
from std_msgs.msg import String, UInt32

from ocu_guard import interface
from ocu_guard.guard import DECELERATION_MPS2, HEARTBEAT_S, Command, Guard


class Node:
    """One lock: rospy calls back from a thread for each connection. Time is monotonic: the guard must not stand still
    with a simulated clock."""

    def __init__(self) -> None:
        rospy.init_node("ocu_guard")
        self._guard = Guard(
            float(rospy.get_param("~deceleration_mps2", DECELERATION_MPS2)),
            float(rospy.get_param("~heartbeat_s", HEARTBEAT_S)),
        )
        self._lock = threading.Lock()
        self._cmd_vel = rospy.Publisher(interface.CMD_VEL, Twist, queue_size=1)
        self._state = rospy.Publisher(interface.STATE, String, queue_size=1, latch=True)
        for topic, kind, hear in (
            (interface.CONTROLLER, Twist, self._controller),
            (interface.OPERATOR, Twist, self._operator),
            (interface.HEARTBEAT, UInt32, self._heartbeat),
            (interface.RELEASE, UInt32, self._release),
            (interface.SPEED, Twist, self._speed),
        ):
            rospy.Subscriber(topic, kind, hear, queue_size=1, tcp_nodelay=True)

    def run(self) -> None:
        """Ticks until ROS ends."""
        next_s = time.monotonic()
        published_s = -1.0
        was = ""
        while not rospy.is_shutdown():
            now_s = time.monotonic()
            with self._lock:
                self._publish(self._guard.tick(now_s))
                state = self._guard.state(now_s)
                report = self._guard.report(now_s)
            if state != was or now_s - published_s >= 1 / interface.STATE_HZ:
                was, published_s = state, now_s
                self._state.publish(json.dumps(report))
            next_s = max(next_s + 1 / interface.TICK_HZ, now_s)
            time.sleep(max(0.0, next_s - time.monotonic()))

    def _controller(self, message: Twist) -> None:
        with self._lock:
            self._publish(self._guard.controller(time.monotonic(), message.linear.x, message.angular.z))

    def _operator(self, message: Twist) -> None:
        with self._lock:
            self._publish(self._guard.operator(time.monotonic(), message.linear.x, message.angular.z))

    def _heartbeat(self, message: UInt32) -> None:
        with self._lock:
            self._guard.heartbeat(time.monotonic(), message.data)

    def _release(self, message: UInt32) -> None:
        with self._lock:
            self._guard.release(time.monotonic(), message.data)

    def _speed(self, message: Twist) -> None:
        with self._lock:
            self._guard.speed(time.monotonic(), message.linear.x)

    def _publish(self, command: Command | None) -> None:
        if command is None:
            return
        message = Twist()
        message.linear.x = command.speed_mps
        message.angular.z = command.angle_rad
        self._cmd_vel.publish(message)


def main() -> None:
    """The node, until ROS ends."""
    try:
        Node().run()
    except rospy.ROSInterruptException:
        pass
