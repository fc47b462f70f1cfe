"""The driving mode: a Bool, a number, a string, or the report of Autoware."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from monitor.values import DriveMode, Mode
from server.judge.message_fields import Rejected, text
from server.judge.topic import Topic

# ControlModeReport.msg of Autoware. With one part driven by hand the car does not drive itself for certain; a car
# that is not ready, or has no command, does not report who drives.
AUTOWARE: Mapping[int, tuple[str, Mode]] = {
    0: ("no command", "unknown"),
    1: ("autonomous", "autonomous"),
    2: ("steering only", "unknown"),
    3: ("speed only", "unknown"),
    4: ("manual", "manual"),
    5: ("disengaged", "manual"),
    6: ("not ready", "unknown"),
}

# Whole values, in any case; the profile of a kind of car may add more.
MODES: Mapping[str, Mode] = {
    **dict.fromkeys(("autonomous", "auto", "automatic", "autopilot"), "autonomous"),
    **dict.fromkeys(("manual", "driver", "human", "disengaged"), "manual"),
}
LONGEST_NAME = 40


def of_bool(message: Any) -> DriveMode:
    """True: autonomous."""
    value = message.get("data") if isinstance(message, Mapping) else None
    if not isinstance(value, bool):
        raise Rejected("data is not true or false")
    return DriveMode(mode="autonomous" if value else "manual", text="true" if value else "false")


def of_number(message: Any) -> DriveMode:
    """A plain number; what it means is a setting."""
    number = _byte(message, "data")
    return DriveMode(mode="unknown", text=str(number), number=number)


def of_string(message: Any) -> DriveMode:
    """A string; an empty one is an unknown mode. Without rosapi the type is not known: a topic that is read by
    its name may be any of these."""
    value = message.get("data") if isinstance(message, Mapping) else None
    if isinstance(value, bool):
        return of_bool(message)
    if isinstance(value, int):
        return of_number(message)
    if isinstance(message, Mapping) and "data" not in message and "mode" in message:
        return of_autoware(message)
    if not isinstance(value, str):
        raise Rejected("data is not a string")
    name = text(message, "data").strip()[:LONGEST_NAME] or "(empty)"
    return DriveMode(mode=MODES.get(name.casefold(), "unknown"), text=name)


def of_autoware(message: Any) -> DriveMode:
    name, mode = AUTOWARE.get(number := _byte(message, "mode"), (f"mode {number}", "unknown"))
    return DriveMode(mode=mode, text=name)


def _byte(message: Any, name: str) -> int:
    value = message.get(name) if isinstance(message, Mapping) else None
    if type(value) is not int or not 0 <= value <= 255:
        raise Rejected(f"{name} is not a number of one byte")
    return value


REPORTS = ("autoware_vehicle_msgs/ControlModeReport", "autoware_auto_vehicle_msgs/ControlModeReport")

TOPICS = (
    Topic(
        signal="mode",
        names=("/catvehicle/control_mode", "/vehicle/status/control_mode"),
        types={
            "std_msgs/String": of_string,
            "std_msgs/Bool": of_bool,
            "std_msgs/UInt8": of_number,
            **dict.fromkeys(REPORTS, of_autoware),
        },
        by_type=REPORTS,
        queue_length=20,
    ),
)
