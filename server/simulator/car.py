"""The simulated car: drives its lap in virtual time and gives what its sensors measure, the same for the same seed."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from server.judge.message import Json, Message, RosVersion
from server.simulator.driver import Driver, Order, SafetyDriver
from server.simulator.lap import ALT_M, lap, lat_lon_deg, utm12_m
from server.simulator.laser import DENSE_HZ, INTERLACED, SICK_HZ, Beams, Laser, Scenery, dense, nearest
from server.simulator.messages import (
    ACCELERATOR,
    ANGLE,
    BRAKE,
    CMD_VEL,
    DISTANCE,
    PUBLISHED,
    SIGNAL_OF_TOPIC,
    VEL,
    Component,
    Published,
    Writer,
)
from server.simulator.running import Scenarios, Stage
from server.simulator.scenario import BridgeFault, Scenario
from server.simulator.scenarios import Planned
from server.simulator.vehicle import (
    GpsError,
    Motion,
    MotionCommand,
    Stack,
    drive,
    effort_percent,
    pedals,
    steering_percent,
    wheel_speed_mps,
)

START_S = 1_790_000_000.0  # seconds since 1970, unless another start is given
START_STATION_M = 300.0  # half a minute before the bends and the stop
STEP_HZ = 100  # of the motion
CONTROL_HZ = 20  # commands, and the by-wire readings
RIVAL_HZ = 100  # of a driver who competes: at an equal rate, chance would decide whose command is mostly the last
GPS_HZ = 10
GPS_LATENCY_S = 0.02

# A client's command holds until it has been silent this long; then the lap's driver takes the wheel again.
CLIENT_HOLDS_S = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """What the car sends at one moment. The messages may be none: silence has its moments too."""

    at_s: float  # seconds since 1970 on the car's clock
    messages: tuple[Message, ...]
    bridge_faults: frozenset[BridgeFault]  # what the bridge is to suffer at this moment


class SimulatedCar:
    """A car that drives without end. Time is virtual: it passes as steps are taken, however fast that is.

    `plan` holds scenarios to come. `scan_beams` replaces the interlaced SICK by so many beams round the whole circle at
    20 Hz. `start_s` is the car's clock at the beginning [s since 1970]. `has_stopper`: whether an obstacle
    stopper stands between the command topic and the wheels; without one the car keeps its last speed in silence.
    `gives_way`: whether the lap's driver is still while somebody else commands, or goes on and competes.
    """

    def __init__(
        self,
        *,
        seed: int = 0,
        ros_version: RosVersion = 1,
        start_s: float = START_S,
        scan_beams: int | None = None,
        plan: Iterable[Planned] = (),
        has_stopper: bool = True,
        gives_way: bool = True,
    ) -> None:
        driver_rng, laser_rng, gps_rng, wheel_rng = (np.random.default_rng((seed, part)) for part in range(4))
        pose = lap().at(START_STATION_M)
        self.motion = Motion(x_m=pose.x_m, y_m=pose.y_m, yaw_rad=pose.yaw_rad)
        self.scenarios = Scenarios(plan)
        self._clock_s = start_s
        self._elapsed_s = 0.0
        self._steps_done = 0
        scenery = Scenery()
        self._stage = Stage(scenery, self.scenarios)
        self._driver = Driver(START_STATION_M, driver_rng)
        self._stack = Stack(has_stopper=has_stopper)
        self._person = SafetyDriver()
        self._gives_way = gives_way
        self._insists_on: MotionCommand | None = None
        self._client_until_s = -math.inf
        self._laser = Laser(scenery, laser_rng)
        self._dense = None if scan_beams is None else dense(scan_beams)
        self._turns = 0
        self._gps_error = GpsError(gps_rng)
        self._wheel_rng = wheel_rng
        self._writer = Writer(ros_version)

    @property
    def published(self) -> tuple[Published, ...]:
        """Every topic the car has."""
        return PUBLISHED

    @property
    def now_s(self) -> float:
        """The car's clock [s since 1970]."""
        return self._clock_s + self._elapsed_s

    @property
    def elapsed_s(self) -> float:
        """Time since the beginning of the drive [s]."""
        return self._elapsed_s

    def skip_clock(self, seconds: float) -> None:
        """Sets the car's clock ahead without the car moving: the world stood still, the clock did not."""
        self._clock_s += seconds

    def start(self, scenario: Scenario, duration_s: float | None = None) -> None:
        """Begins a scenario now."""
        self.scenarios.start(scenario, self._elapsed_s, duration_s)

    def stop(self, name: str | None = None) -> None:
        """End a scenario, or all of them, now."""
        self.scenarios.stop(name)

    def follow(self, message: Json) -> None:
        """Apply a Twist that a client of the bridge published: linear.x in m/s, angular.z as tyre angle in rad.

        The last message wins. The lap's driver gives way meanwhile, if that is its manner, and takes over when no
        more come. An unknown tyre angle (NaN, null) keeps the tyres as they are; without a speed the message is
        ignored.
        """
        speed_mps = _inner(message, "linear", "x")
        if speed_mps is None:
            return
        tyre_rad = _inner(message, "angular", "z")
        command = MotionCommand(speed_mps=speed_mps, tyre_rad=self._stack.tyre_rad if tyre_rad is None else tyre_rad)
        self._stack.receive(command, self._elapsed_s)
        self._client_until_s = self._elapsed_s + CLIENT_HOLDS_S

    def messages(self) -> Iterator[Message]:
        """Everything the car sends, in the order of time."""
        for step in self.steps():
            yield from step.messages

    def steps(self) -> Iterator[Step]:
        """The drive, moment by moment. Only one iterator may be in use."""
        schedule = self._schedule()
        second = 0
        while True:
            for offset_s, kind in schedule:
                self._go_on(second + offset_s)
                yield Step(
                    at_s=self.now_s,
                    messages=tuple(self._sent(kind)),
                    bridge_faults=frozenset(self.scenarios.bridge_faults),
                )
            second += 1

    def state(self) -> dict[str, Any]:
        """The scenarios and the truth about the car, which its sensors only come near."""
        lat_deg, lon_deg = lat_lon_deg(self.motion.x_m, self.motion.y_m)
        return {
            "elapsed_s": round(self._elapsed_s, 3),
            "truth": {
                "speed_mps": self.motion.speed_mps,
                "lat_deg": lat_deg,
                "lon_deg": lon_deg,
                "yaw_rad": math.remainder(self.motion.yaw_rad, 2 * math.pi),
                "station_m": round(self._driver.station_m, 1),
                "mode": self._person.mode,
                "interventions": [one.as_json(self._clock_s) for one in self._person.interventions],
            },
            "scenarios": self.scenarios.state(self._elapsed_s),
        }

    def _schedule(self) -> list[tuple[float, str]]:
        """The schedule of one second: when each group of sensors publishes, no two at the same moment."""
        groups = [("control", CONTROL_HZ, 0.0021), ("gps", GPS_HZ, 0.0312), ("diagnostics", 1, 0.5005)]
        if self._dense is None:
            groups.append(("laser", SICK_HZ, 0.0047))
        else:
            groups += [("laser", DENSE_HZ, 0.0187), ("nearest", SICK_HZ, 0.0047)]
        if not self._gives_way:
            groups.append(("rival", RIVAL_HZ, 0.0009))
        return sorted((phase + tick / rate, name) for name, rate, phase in groups for tick in range(rate))

    def _go_on(self, until_s: float) -> None:
        """Move the car to a moment, in fixed steps, so that the motion does not depend on the calls."""
        while (self._steps_done + 1) / STEP_HZ <= until_s:
            self.motion = drive(self.motion, self._stack.passed(self._steps_done / STEP_HZ), 1 / STEP_HZ)
            self._steps_done += 1
            self._stage.moved(self.motion, 1 / STEP_HZ)
        self._elapsed_s = until_s
        self.scenarios.advance(until_s)

    def _sent(self, kind: str) -> Iterator[Message]:
        for message in self._measured(kind):
            yield from self.scenarios.lay_over(message, SIGNAL_OF_TOPIC[message.topic])

    def _measured(self, kind: str) -> Iterable[Message]:
        now = self.motion.after(self._elapsed_s - self._steps_done / STEP_HZ)
        match kind:
            case "control":
                return self._control(now)
            case "laser" if self._dense is None:
                beams = self._next_turn()
                return self._scan_and_nearest(now, beams)
            case "laser":
                assert self._dense is not None
                return (self._scan(now, self._dense, self._laser.ranges_m(now, self._dense)),)
            case "nearest":
                beams = self._next_turn()
                return self._nearest(self._laser.ranges_m(now, beams), beams)
            case "gps":
                return self._gps(now)
            case "rival":
                return self._continue_commands()
            case _:
                return (self._writer.diagnostics(self.now_s, self._components()),)

    def _control(self, now: Motion) -> list[Message]:
        at_s, writer = self.now_s, self._writer
        brake, accelerator = pedals(now)
        person, orders = self._person, self.scenarios.orders
        person.step(orders, self._elapsed_s, now)
        if person.pedal_percent:
            brake, accelerator = max(brake, person.pedal_percent), 0.0
        messages = [
            writer.mode(at_s, person.mode),
            writer.twist(VEL, at_s, wheel_speed_mps(now, self._wheel_rng)),
            writer.effort(BRAKE, at_s, effort_percent(brake)),
            writer.effort(ACCELERATOR, at_s, effort_percent(accelerator)),
            writer.steering(at_s, steering_percent(now)),
        ]
        tyre_rad = self._stack.tyre_rad
        if Order.SILENCE in orders:
            self._client_until_s = max(self._client_until_s, self._elapsed_s)  # it takes the wheel anew afterwards
            self._insists_on = None
        elif not self._gives_way or self._elapsed_s >= self._client_until_s:
            if self._elapsed_s >= self._client_until_s > -math.inf:
                self._driver.resume(now)
                self._client_until_s = -math.inf
            self._stage.set(now, self._driver.station_m, orders)
            command = self._driver.command(now, self._elapsed_s, 1 / CONTROL_HZ, orders, self._stage.blocked_at_m)
            tyre_rad = command.tyre_rad
            if person.mode == "manual":
                self._driver.resume(now)  # its controller commands nothing meanwhile, and continues from here
                self._insists_on = None
            else:
                self._stack.receive(command, self._elapsed_s)
                self._insists_on = command
                messages.append(writer.twist(CMD_VEL, at_s, command.speed_mps, command.tyre_rad))
        self._stack.hand = person.hand(tyre_rad)
        return messages

    def _continue_commands(self) -> Iterable[Message]:
        """Repeat the last command, as a competing driver does."""
        command = self._insists_on
        if command is None:
            return ()
        self._stack.receive(command, self._elapsed_s)
        return (self._writer.twist(CMD_VEL, self.now_s, command.speed_mps, command.tyre_rad),)

    def _next_turn(self) -> Beams:
        self._turns += 1
        return INTERLACED[self._turns % 2]

    def _scan_and_nearest(self, now: Motion, beams: Beams) -> list[Message]:
        ranges = self._laser.ranges_m(now, beams)
        return [self._scan(now, beams, ranges), *self._nearest(ranges, beams)]

    def _scan(self, now: Motion, beams: Beams, ranges: Any) -> Message:
        return self._writer.scan(self.now_s, self.now_s - beams.scan_time_s / 2, beams, ranges)

    def _nearest(self, ranges: Any, beams: Beams) -> list[Message]:
        distance_m, bearing_rad = nearest(ranges, beams)
        self._stack.see(distance_m)
        return [
            self._writer.number(DISTANCE, self.now_s, distance_m),
            self._writer.number(ANGLE, self.now_s, bearing_rad),
        ]

    def _gps(self, now: Motion) -> list[Message]:
        then = now.after(-GPS_LATENCY_S)
        at_s, stamp_s = self.now_s, self.now_s - GPS_LATENCY_S
        east_m, north_m, up_m = self._gps_error.next_m(1 / GPS_HZ)
        lat_deg, lon_deg = lat_lon_deg(then.x_m + east_m, then.y_m + north_m)
        alt_m = ALT_M + up_m
        utm_x_m, utm_y_m = utm12_m(lat_deg, lon_deg)
        velocity = (then.speed_mps * math.cos(then.yaw_rad), then.speed_mps * math.sin(then.yaw_rad), 0.0)
        return [
            self._writer.fix(at_s, stamp_s, lat_deg, lon_deg, alt_m),
            self._writer.odometry(at_s, stamp_s, (utm_x_m, utm_y_m, alt_m), then.yaw_rad, velocity),
        ]

    def _components(self) -> list[Component]:
        rate = SICK_HZ if self._dense is None else DENSE_HZ
        volts = 12.6 + 0.1 * math.sin(self._elapsed_s / 30)
        return [
            (0, "sicklms: laser scans", "Scans at the expected rate", "SICK LMS291", {"rate (Hz)": f"{rate:.1f}"}),
            (0, "gps: receiver", "Position found", "GNSS receiver", {"satellites": "11"}),
            (0, "by-wire: brake", "Ready", "by-wire unit", {"mode": "automatic"}),
            (0, "by-wire: steering", "Ready", "by-wire unit", {"mode": "automatic"}),
            (0, "computer: supply", "Voltage normal", "car computer", {"volts": f"{volts:.2f}"}),
        ]


def _inner(message: Json, *path: str) -> float | None:
    """A finite number inside a message; None where there is none."""
    value: Any = message
    for name in path:
        value = value.get(name) if isinstance(value, dict) else None
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        return float(value) if math.isfinite(value) else None
    except OverflowError:  # an integer beyond all floats
        return None
