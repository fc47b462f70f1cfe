"""The simulated car behind a rosbridge of its own, at its own pace, with scenarios started and stopped from outside."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable, Iterable
from typing import Any

from server.judge.message import Json, RosVersion
from server.rosbridge_server.server import CannotListen, RosBridge, ServiceFailed
from server.simulator.car import SimulatedCar, Step
from server.simulator.messages import CMD_VEL
from server.simulator.scenario import BridgeFault
from server.simulator.scenarios import Planned, UnknownScenario, check_duration, find, planned

SCENARIO_SERVICE = "/catgraph/simulator/scenario"
STATE_SERVICE = "/catgraph/simulator/state"

SOON_S = 0.0005  # the loop cannot sleep more finely
LATE_S = 1.0  # later than this the car does not catch up: the process was stopped or the machine slept
TURN_S = 0.002  # when catching up, others get a turn at least this often
REVIVE_AGAIN_S = 1.0

log = logging.getLogger(__name__)


class CarService:
    """One simulated car on one port.

    `port` 0 takes a free one. `scenarios` come as NAME, NAME@T or NAME@T+D (T and D in seconds of the drive). `rate` is
    how many times faster than real time the car lives; `clock` returns the time at the beginning [s since 1970]. Raises
    UnknownScenario and ValueError, each with one sentence for a person. `like` is the bridge's.
    """

    def __init__(
        self,
        *,
        host: str = "127.0.0.1",
        port: int = 0,
        seed: int = 0,
        ros_version: RosVersion = 1,
        scan_beams: int | None = None,
        rate: float = 1.0,
        scenarios: Iterable[str | Planned] = (),
        clock: Callable[[], float] = time.time,
        has_stopper: bool = True,
        gives_way: bool = True,
    ) -> None:
        if not 0 < rate <= 100:
            raise ValueError(f"The rate must be above 0 and at most 100, not {rate:g}.")
        plan = tuple(planned(entry) if isinstance(entry, str) else entry for entry in scenarios)
        self._host, self._port, self._rate, self._clock = host, port, rate, clock
        self.car = SimulatedCar(
            seed=seed,
            ros_version=ros_version,
            start_s=clock(),
            scan_beams=scan_beams,
            plan=plan,
            has_stopper=has_stopper,
            gives_way=gives_way,
        )
        self.bridge = RosBridge(ros_version=ros_version, now=lambda: self.car.now_s, node="/simulated_car")
        for published in self.car.published:
            self.bridge.advertise(published.topic, published.type)
        self.bridge.advertise_rosout()
        self.bridge.on_publish.append(self._on_publish)
        self.bridge.add_service(SCENARIO_SERVICE, "catgraph/Scenario", self._scenario_called, ("name", "stop"))
        self.bridge.add_service(STATE_SERVICE, "catgraph/SimulatorState", lambda _: self.state())
        self._suffered: frozenset[BridgeFault] = frozenset()
        self._driving: asyncio.Task[None] | None = None

    async def start(self) -> int:
        """Start to listen and to drive; return the port. Raises CannotListen with one sentence for a person."""
        port = await self.bridge.start(self._host, self._port)
        self._driving = asyncio.create_task(self._drive())
        return port

    async def stop(self) -> None:
        """Stops driving and closes the bridge. May be called more than once."""
        driving, self._driving = self._driving, None
        if driving is not None:
            driving.cancel()
            await asyncio.gather(driving, return_exceptions=True)
        await self.bridge.stop()

    async def wait(self) -> None:
        """Returns when the car was stopped; raises what went wrong in driving."""
        driving = self._driving
        if driving is not None:
            await asyncio.wait((driving,))
            if not driving.cancelled():
                driving.result()

    def start_scenario(self, name: str, duration_s: float | None = None) -> None:
        """Begins a scenario now, for its own duration or the one given. Raises UnknownScenario."""
        scenario = find(name)
        self.car.start(scenario, None if duration_s is None else check_duration(duration_s))

    def stop_scenario(self, name: str | None = None) -> None:
        """Ends one scenario, or all that run. Raises UnknownScenario."""
        self.car.stop(None if name is None else find(name).name)

    def state(self) -> dict[str, Any]:
        """Every scenario with its state, and the truth about the car."""
        return {**self.car.state(), "rate": self._rate, "clients": self.bridge.clients}

    async def _drive(self) -> None:
        # building the car and opening the port took their time: its clock is set when it drives off
        self.car.skip_clock(self._clock() - self.car.now_s)
        steps = self.car.steps()
        step = next(steps)
        began_s = time.monotonic() - self.car.elapsed_s / self._rate
        turn_ends_s = time.monotonic() + TURN_S
        while True:
            wait_s = began_s + self.car.elapsed_s / self._rate - time.monotonic()
            if wait_s > SOON_S:
                await asyncio.sleep(wait_s)
                turn_ends_s = time.monotonic() + TURN_S
            elif wait_s < -LATE_S:
                began_s -= wait_s
                self.car.skip_clock(-wait_s * self._rate)
            elif time.monotonic() > turn_ends_s:
                await asyncio.sleep(0)
                turn_ends_s = time.monotonic() + TURN_S
            if step.bridge_faults != self._suffered:
                await self._suffer(step.bridge_faults)
            self._publish(step)
            step = next(steps)

    def _publish(self, step: Step) -> None:
        for message in step.messages:
            self.bridge.publish(message.topic, message.message)

    async def _suffer(self, faults: frozenset[BridgeFault]) -> None:
        """Freezes, thaws, kills or revives the bridge, whatever makes it as the scenarios want it."""
        before, self._suffered = self._suffered, faults
        if "kill" in faults and "kill" not in before:
            await self.bridge.kill()
        elif "kill" in before and "kill" not in faults and not await self._has_revived():
            self._suffered = faults | {"kill"}  # tried again with the next step
        if "kill" in self._suffered:
            return
        if "freeze" in faults:
            self.bridge.freeze()
        else:
            self.bridge.thaw()

    async def _has_revived(self) -> bool:
        try:
            await self.bridge.revive()
        except CannotListen as error:
            log.warning("bridge not restarted yet: error=%s", error)
            await asyncio.sleep(REVIVE_AGAIN_S)
            return False
        return True

    def _on_publish(self, topic: str, type: str, message: Json) -> None:
        if topic != CMD_VEL.topic:
            return
        kind = type.rpartition("/")[2]
        twist = message.get("twist") if kind == "TwistStamped" else message if kind == "Twist" else None
        if isinstance(twist, dict):
            self.car.follow(twist)

    def _scenario_called(self, args: Json) -> Json:
        name, stop, duration_s = args.get("name", ""), args.get("stop", False), args.get("duration_s")
        if not isinstance(name, str) or not isinstance(stop, bool):
            raise ServiceFailed('The arguments are {"name": text, "stop": true or false}.')
        if duration_s is not None and (isinstance(duration_s, bool) or not isinstance(duration_s, int | float)):
            raise ServiceFailed("duration_s is a number of seconds.")
        try:
            if stop:
                self.stop_scenario(name or None)
            else:
                self.start_scenario(name, duration_s)
        except UnknownScenario as error:
            raise ServiceFailed(str(error)) from None
        return {"success": True, "message": _confirmation(name, stop)}


def _confirmation(name: str, stop: bool) -> str:
    if not stop:
        return f"{name} started"
    return f"{name} stopped" if name else "all scenarios stopped"


async def serve_car(
    host: str = "127.0.0.1", port: int = 0, *, seed: int = 0, scenarios: Iterable[str | Planned] = ()
) -> tuple[CarService, int]:
    """A simulated car that is driving, and its port. Raises CannotListen and what CarService raises."""
    service = CarService(host=host, port=port, seed=seed, scenarios=scenarios)
    return service, await service.start()
