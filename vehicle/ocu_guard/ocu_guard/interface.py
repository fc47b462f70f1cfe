"""Names and numbers that both shells share: topics, parameters, how often."""

from __future__ import annotations

CMD_VEL = "cmd_vel"  # out: to the car (or to its obstacle stopper)
CONTROLLER = "cmd_vel_controller"  # in: what the controllers published on cmd_vel before the guard stood there
OPERATOR = "ocu_guard/cmd_vel"  # in: the operator slows the car
HEARTBEAT = "ocu_guard/heartbeat"  # in: std_msgs/UInt32, another number 5 times a second, 0 = farewell
RELEASE = "ocu_guard/release"  # in: std_msgs/UInt32, the number of the hold that ends
STATE = "ocu_guard/state"  # out: std_msgs/String, JSON
SPEED = "vel"  # in: geometry_msgs/Twist, the measured speed in linear.x

TICK_HZ = 20.0
STATE_HZ = 5.0
