"""The guard before /catvehicle/cmd_vel. The controllers are started with cmd_vel:=/catvehicle/cmd_vel_controller."""

from launch import LaunchDescription
from launch_ros.actions import Node

VEHICLE = "/catvehicle"


def generate_launch_description() -> LaunchDescription:
    """One node, started again where it ends."""
    return LaunchDescription(
        [
            Node(
                package="ocu_guard",
                executable="ocu_guard_node",
                name="ocu_guard",
                output="screen",
                respawn=True,
                remappings=[(name, VEHICLE + "/" + name) for name in ("cmd_vel", "cmd_vel_controller", "vel")],
            )
        ]
    )
