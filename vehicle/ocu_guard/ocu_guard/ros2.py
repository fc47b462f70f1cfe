"""The guard as a ROS 2 node (Humble and newer): reads topics, ticks, publishes; decides nothing."""

from __future__ import annotations

import json
import time

import rclpy
from geometry_msgs.msg import Twist
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.clock import Clock, ClockType
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node as RosNode
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import String, UInt32

from ocu_guard import interface
from ocu_guard.guard import DECELERATION_MPS2, HEARTBEAT_S, Command, Guard


class Node(RosNode):
    """Runs in one thread, so nothing is locked. Ticks by the steady clock: the guard must not stand still with a
    simulated one.

    Subscriptions are volatile: rosbridge publishes transient local, and a guard that starts again must not receive the
    operator's commands of before. Controllers and the speed are subscribed best effort: a reliable subscription
    receives nothing from a best-effort publisher, the usual one for measurements.
    """

    def __init__(self) -> None:
        super().__init__("ocu_guard")
        any_number = ParameterDescriptor(dynamic_typing=True)  # else `deceleration_mps2:=3` is refused: an integer
        self.declare_parameter("deceleration_mps2", DECELERATION_MPS2, any_number)
        self.declare_parameter("heartbeat_s", HEARTBEAT_S, any_number)
        self._guard = Guard(
            float(self.get_parameter("deceleration_mps2").value), float(self.get_parameter("heartbeat_s").value)
        )
        self._was = ""
        self._published_s = -1.0
        self._cmd_vel = self.create_publisher(Twist, interface.CMD_VEL, 1)
        kept = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._state = self.create_publisher(String, interface.STATE, kept)
        reliable = QoSProfile(depth=1)
        best_effort = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
        for topic, kind, receive, qos in (
            (interface.CONTROLLER, Twist, self._controller, best_effort),
            (interface.OPERATOR, Twist, self._operator, reliable),
            (interface.HEARTBEAT, UInt32, self._heartbeat, reliable),
            (interface.RELEASE, UInt32, self._release, reliable),
            (interface.SPEED, Twist, self._speed, best_effort),
        ):
            self.create_subscription(kind, topic, receive, qos)
        self.create_timer(1 / interface.TICK_HZ, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _tick(self) -> None:
        now_s = time.monotonic()
        self._publish(self._guard.tick(now_s))
        state = self._guard.state(now_s)
        if state != self._was or now_s - self._published_s >= 1 / interface.STATE_HZ:
            self._was, self._published_s = state, now_s
            message = String()
            message.data = json.dumps(self._guard.report(now_s))
            self._state.publish(message)

    def _controller(self, message: Twist) -> None:
        self._publish(self._guard.controller(time.monotonic(), message.linear.x, message.angular.z))

    def _operator(self, message: Twist) -> None:
        self._publish(self._guard.operator(time.monotonic(), message.linear.x, message.angular.z))

    def _heartbeat(self, message: UInt32) -> None:
        self._guard.heartbeat(time.monotonic(), message.data)

    def _release(self, message: UInt32) -> None:
        self._guard.release(time.monotonic(), message.data)

    def _speed(self, message: Twist) -> None:
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
    rclpy.init()
    node = Node()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):  # Ctrl-C, and SIGTERM
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
