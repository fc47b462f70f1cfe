"""Makes a drive during which the clock of the recorder was set, as often and wherever a test wants."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

from mcap.writer import Writer

from tests.server.recording.bags import BEGIN_S, Drive, Row, build, typestore, write_ros1, write_ros2

Container = Literal["bag", "db3", "mcap", "plain", "bare"]
CONTAINERS: tuple[Container, ...] = ("bag", "db3", "mcap", "plain", "bare")
Step = tuple[float, float]  # after so many seconds of the drive, the clock is set by so many, ahead positive
LENGTH_S = 60.0
FAST_S = (20.0, 30.0)  # above the limit of speed


def _stamp(at_s: float, version: int) -> dict[str, int]:
    """Since BEGIN_S."""
    seconds, nanoseconds = divmod(round((BEGIN_S + at_s) * 1e9), 10**9)
    return {"sec": seconds, "nanosec": nanoseconds}


def speed_mps(at_s: float) -> float:
    """Never constant, so that nothing is frozen."""
    return (12.5 if FAST_S[0] <= at_s < FAST_S[1] else 8.0) + 0.2 * (round(at_s * 10) % 7)


def rows(
    version: int, steps: Sequence[Step] = (), *, silent_s: tuple[float, float] | None = None, has_own_clock: bool = True
) -> list[Row]:
    """Wheels and a GPS receiver with stamps of the recorder's clock, and an IMU with a clock of its own.

    `silent_s`: from where on and for how long nothing was received.
    """

    def logged_s(at_s: float) -> float:
        return at_s + sum(by_s for after_s, by_s in steps if at_s >= after_s)

    found: list[tuple[float, Row]] = []
    for number in range(round(LENGTH_S * 20)):
        at_s = 0.003 + number / 20
        if silent_s is not None and at_s >= silent_s[0]:
            at_s += silent_s[1]
        time_s, own_s = logged_s(at_s), at_s - BEGIN_S + 500.0  # since it was switched on
        if number % 2 == 0:
            twist = {"linear": {"x": speed_mps(at_s)}}
            header = {"stamp": _stamp(time_s, version)}
            found.append(
                (at_s, (time_s, "/twist", "geometry_msgs/msg/TwistStamped", {"header": header, "twist": twist}))
            )
        if number % 4 == 1:
            fix = {
                "header": {"stamp": _stamp(time_s, version)},
                "status": {"status": 0},
                "latitude": 48.0 + at_s * 7e-5,
            }
            found.append((at_s, (time_s, "/fix", "sensor_msgs/msg/NavSatFix", {**fix, "longitude": 11.0})))
        if has_own_clock:
            imu = {"header": {"stamp": _stamp(own_s, version)}, "orientation": {"w": 1.0}}
            found.append((at_s, (time_s, "/imu", "sensor_msgs/msg/Imu", imu)))
    return [row for _, row in found]


def write(folder: Path, container: Container, **how: Any) -> Path:
    """One recording of `rows`: a ROS 1 bag, a ROS 2 bag of sqlite3 or MCAP, an MCAP file with or without an index."""
    folder.mkdir(parents=True, exist_ok=True)
    if container == "bag":
        return write_ros1(folder / "drive.bag", Drive(messages=rows(1, **how), chunk_bytes=40_000))
    if container in ("db3", "mcap"):
        storage: Literal["mcap", "sqlite3"] = "mcap" if container == "mcap" else "sqlite3"
        return write_ros2(folder / "drive", Drive(messages=rows(2, **how)), storage=storage)
    return _write_mcap(folder / "drive.mcap", rows(2, **how), is_indexed=container == "plain")


def _write_mcap(path: Path, messages: Sequence[Row], *, is_indexed: bool) -> Path:
    store, channels = typestore(2, {}), dict[str, int]()
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=20_000, use_chunking=is_indexed)
        writer.start(profile="ros2", library="another")
        for at_s, topic, type, message in messages:
            if topic not in channels:
                text, _ = store.generate_msgdef(type, ros_version=2)
                channels[topic] = writer.register_channel(
                    topic, "cdr", writer.register_schema(type, "ros2msg", text.encode())
                )
            time_ns = BEGIN_S * 10**9 + round(at_s * 1e9)
            data = bytes(store.serialize_cdr(build(store, type, message), type))
            writer.add_message(channels[topic], time_ns, data, time_ns)
        writer.finish()  # type: ignore[no-untyped-call]
    return path
