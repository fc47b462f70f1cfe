"""Operator, controller and car around the guard's node, run by ROS's own Python.

`ros_driver.py 1|2 VEHICLE GUARD`: the ROS, and the namespaces of the car's topics and of the guard's.

Reads one JSON object a line and takes over its fields; publishes what they say every 50 ms; writes a line for each
command and each state that the guard publishes. Moments are of the machine's monotonic clock [s].

controller, operator: [m/s, rad] or null. speed: m/s, "follows" (the car does what it was commanded) or null.
heartbeat: true counts on, 5 times a second. Once only, when they come: release and beat, a number each.
"""

from __future__ import annotations

import json
import sys
import threading
import time

TICK_S = 0.05
wanted = {"controller": None, "operator": None, "speed": None, "heartbeat": False}
once = []  # (topic, number)
lock = threading.Lock()
commanded_mps = [3.0]


def write(**line):
    with lock:
        print(json.dumps(line), flush=True)


def received_command(message):
    commanded_mps[0] = message.linear.x
    write(at_s=time.monotonic(), command=[message.linear.x, message.angular.z])


def received_state(message):
    write(at_s=time.monotonic(), state=json.loads(message.data))


class Ros1:
    def __init__(self, vehicle, guard):
        import rospy
        from geometry_msgs.msg import Twist
        from std_msgs.msg import String, UInt32

        rospy.init_node("driver", anonymous=True, disable_signals=True)
        self.twist, self.number = Twist, UInt32
        rospy.Subscriber(f"{vehicle}/cmd_vel", Twist, received_command, tcp_nodelay=True)
        rospy.Subscriber(f"{guard}/ocu_guard/state", String, received_state)
        self.publishers = {
            topic: rospy.Publisher(name, kind, queue_size=5, tcp_nodelay=True)
            for topic, name, kind in topics(vehicle, guard, Twist, UInt32)
        }

    def is_matched(self):
        return all(publisher.get_num_connections() for publisher in self.publishers.values())


class Ros2:
    """As rosbridge publishes: reliable, and kept for who subscribes later. The car's own topics are best effort."""

    def __init__(self, vehicle, guard):
        import rclpy
        from geometry_msgs.msg import Twist
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
        from std_msgs.msg import String, UInt32

        rclpy.init()
        node = rclpy.create_node("driver")
        self.twist, self.number = Twist, UInt32
        kept = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        sensor = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
        node.create_subscription(Twist, f"{vehicle}/cmd_vel", received_command, 10)
        node.create_subscription(String, f"{guard}/ocu_guard/state", received_state, kept)
        self.publishers = {
            topic: node.create_publisher(kind, name, sensor if topic in ("vel", "cmd_vel_controller") else kept)
            for topic, name, kind in topics(vehicle, guard, Twist, UInt32)
        }
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        threading.Thread(target=executor.spin, daemon=True).start()

    def is_matched(self):
        return all(publisher.get_subscription_count() for publisher in self.publishers.values())


def topics(vehicle, guard, twist, number):
    return (
        ("cmd_vel_controller", f"{vehicle}/cmd_vel_controller", twist),
        ("vel", f"{vehicle}/vel", twist),
        ("ocu_guard/cmd_vel", f"{guard}/ocu_guard/cmd_vel", twist),
        ("ocu_guard/heartbeat", f"{guard}/ocu_guard/heartbeat", number),
        ("ocu_guard/release", f"{guard}/ocu_guard/release", number),
    )


def read():
    for line in sys.stdin:
        order = json.loads(line)
        for topic in ("release", "heartbeat"):
            number = order.pop("beat" if topic == "heartbeat" else topic, None)
            if number is not None:
                once.append((f"ocu_guard/{topic}", number))
        wanted.update(order)
    sys.exit()


def main():
    ros = {"1": Ros1, "2": Ros2}[sys.argv[1]](*sys.argv[2:])

    def publish(topic, value):
        if isinstance(value, int) and topic.startswith("ocu_guard/"):
            ros.publishers[topic].publish(ros.number(data=value))
            return
        speed_mps, angle_rad = value
        message = ros.twist()
        message.linear.x, message.angular.z = float(speed_mps), float(angle_rad)
        ros.publishers[topic].publish(message)

    def run():
        was_matched, step, count = None, 0, 100
        while True:
            if (is_matched := ros.is_matched()) != was_matched:
                was_matched = is_matched
                write(at_s=time.monotonic(), matched=is_matched)
            while once:
                publish(*once.pop(0))
            if wanted["heartbeat"] and step % 4 == 0:
                count += 1
                publish("ocu_guard/heartbeat", count)
            speed = wanted["speed"]
            if speed is not None:
                publish("vel", (commanded_mps[0] if speed == "follows" else speed, 0.0))
            for topic, name in (("cmd_vel_controller", "controller"), ("ocu_guard/cmd_vel", "operator")):
                if wanted[name] is not None:
                    publish(topic, wanted[name])
            step += 1
            time.sleep(TICK_S)

    threading.Thread(target=run, daemon=True).start()
    read()


main()
