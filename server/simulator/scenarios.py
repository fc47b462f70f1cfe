"""Every fault that can be started by name: what it is, how long it lasts, and which alarm it should raise."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from server.judge.message import Message
from server.simulator import faults
from server.simulator.driver import Order
from server.simulator.effects import (
    BlindLaser,
    BothPedals,
    ComponentReport,
    Effect,
    FrozenSpeed,
    GpsOffset,
    IgnoredCommand,
    ObstacleAhead,
    Silence,
    SlowRate,
    Speeding,
)
from server.simulator.scenario import Scenario

LONGEST_S = 3600.0

_SCENARIOS = (
    Scenario(
        name="speeding",
        sentence="The car drives 12 m/s for some seconds, as soon as the lap allows it (at most half a minute).",
        duration_s=60.0,  # at most; it ends by itself after some seconds above the limit
        alarm="speed above limit",
        # over a recording, where only the sent speed differs: nobody ordered it, nobody keeps distance for it, and
        # the position does not follow it
        consequences=("command without response", "nearest object", "speed sources"),
        effect=Speeding,
        order=Order.HURRY,
        order_suffices=True,
    ),
    Scenario(
        name="obstacle",
        sentence="Another car crosses the path; the driver stops before it until it leaves.",
        duration_s=10.0,  # short of the ten seconds of standing after which that raises an alarm too
        alarm="obstacle in corridor",
        # where the car stood already, the obstacle stopper keeps it standing
        consequences=("nearest object", "vehicle not moving"),
        effect=ObstacleAhead,
        order=Order.YIELD,
        order_suffices=True,
    ),
    Scenario(
        name="near-object",
        sentence="The distance estimator reports an object 3.5 m ahead; the laser sees none.",
        duration_s=5.0,
        alarm="nearest object",
        effect=faults.NearObject,
    ),
    Scenario(
        name="command-ignored",
        sentence="The controller commands a stop, and the car ignores it.",
        duration_s=6.0,
        alarm="command without response",
        effect=IgnoredCommand,
        order=Order.STEADY,
    ),
    Scenario(
        name="standing",
        sentence="The car stops on its lap and stays there.",
        duration_s=20.0,  # down to standstill, and ten seconds until that raises an alarm
        alarm="vehicle not moving",
        order=Order.STAND,
        order_suffices=True,
    ),
    Scenario(
        name="pedal-conflict",
        sentence="Brake and accelerator are down at the same time.",
        duration_s=5.0,
        alarm="brake and accelerator together",
        effect=BothPedals,
    ),
    Scenario(
        name="gps-drift",
        sentence="The car stops, and its position drifts by 16 m.",
        # 5 s down to standstill, 3 s for the judge to take its anchor, 7 s of wandering, and time to notice
        duration_s=24.0,
        alarm="GPS drift at standstill",
        consequences=("vehicle not moving", "phone and car disagree"),
        # slower than the jump rule's 3 m/s; farther than 4.3 times the 2.5 m of a receiver that reports no quality
        effect=lambda: GpsOffset(pace_mps=2.3, most_m=16.0, during="standing", after_s=3.0, back_mps=1.5),
        order=Order.STAND,
    ),
    Scenario(
        name="gps-jump",
        sentence="The position moves away at 23 m/s, as a real receiver's did, then is correct again.",
        duration_s=6.0,
        alarm="GPS jump",
        consequences=("GPS drift at standstill", "phone and car disagree"),
        effect=lambda: GpsOffset(pace_mps=23.0, most_m=1000.0, during="always", back_mps=None),
    ),
    Scenario(
        name="phone-mismatch",
        sentence="The position drifts 60 m aside while the car drives; a phone in the car stays correct.",
        duration_s=90.0,
        alarm="phone and car disagree",
        # 60 m is beyond the gate of the worst phone fix that is used (50 m)
        effect=lambda: GpsOffset(pace_mps=2.0, most_m=60.0, during="moving", back_mps=2.0),
    ),
    Scenario(
        name="stale-gps",
        sentence="The position stops; everything else continues.",
        duration_s=10.0,
        alarm="GPS stale",
        consequences=("signal stale: position",),
        effect=lambda: Silence("position"),
    ),
    Scenario(
        name="no-fix",
        sentence="The receiver reports no fix; its coordinates continue.",
        duration_s=10.0,
        alarm="GPS no fix",
        effect=faults.NoFix,
    ),
    Scenario(
        name="silent-scan",
        sentence="The laser scan stops; everything else continues.",
        duration_s=10.0,
        alarm="signal stale: scan",
        effect=lambda: Silence("scan"),
    ),
    Scenario(
        name="blind-laser",
        sentence="Scans arrive, but no beam has a return.",
        duration_s=10.0,
        alarm="laser cannot see",
        effect=BlindLaser,
    ),
    Scenario(
        name="frozen-speed",
        sentence="The car keeps driving, but its speed messages repeat one value.",
        duration_s=10.0,
        alarm="signal frozen: speed",
        # braking does not show, and where the car slows for a bend its stopping distance is reckoned too long
        consequences=("command without response", "obstacle in corridor"),
        effect=FrozenSpeed,
        order=Order.STEADY,  # faster than the frozen speed, the true way would look like a GPS jump
    ),
    Scenario(
        name="short-scan",
        sentence="Each scan lacks ten of the beams that its angles declare.",
        duration_s=6.0,
        alarm="scan inconsistent",
        effect=faults.TruncatedScan,
    ),
    Scenario(
        name="frozen-position",
        sentence="The car keeps driving, but its positions repeat one place, with new stamps.",
        duration_s=10.0,
        alarm="signal frozen: position",
        consequences=("phone and car disagree", "GPS drift at standstill"),  # it ends with a jump
        effect=faults.FrozenPosition,
    ),
    Scenario(
        name="frozen-scan",
        sentence="The laser sends one scan again and again, its old stamp included.",
        duration_s=8.0,
        alarm="signal frozen: scan",
        consequences=("obstacle in corridor",),
        effect=faults.FrozenScan,
        order=Order.STEADY,  # faster, and the way seen free would be too short
    ),
    Scenario(
        name="slow-rate",
        sentence="Speed comes 10 times a second instead of 20.",
        duration_s=15.0,
        alarm="signal slower than expected: speed",
        effect=lambda: SlowRate("speed"),
    ),
    Scenario(
        name="all-slow",
        sentence="Every second message of all topics is lost, as over an overloaded radio.",
        duration_s=15.0,
        alarm="all signals slow",
        effect=SlowRate,
    ),
    Scenario(
        name="clock-jump",
        sentence="The car's clock is set back by half a minute, then corrected after some seconds.",
        duration_s=5.0,
        alarm="clock jump",
        effect=lambda: faults.OtherClock(step_s=-30.0),
    ),
    Scenario(
        name="clock-slow",
        sentence="The car's clock loses a second every four, up to 4 s, as if messages came ever later.",
        duration_s=20.0,
        alarm="stamp offset",
        effect=lambda: faults.OtherClock(pace=-0.25, most_s=4.0),
    ),
    Scenario(
        name="diagnostics-error",
        sentence="One component of the car reports an error.",
        duration_s=10.0,
        alarm="/diagnostics ERROR",
        effect=lambda: ComponentReport(2, "No data from the device for 2.0 s"),
    ),
    Scenario(
        name="diagnostics-warning",
        sentence="One component of the car reports a warning.",
        duration_s=10.0,
        alarm="/diagnostics WARN",
        effect=lambda: ComponentReport(1, "Temperature high"),
    ),
    Scenario(
        name="controller-silent",
        sentence="The controller stops publishing commands: the obstacle stopper brakes, if the car has one.",
        duration_s=20.0,
        alarm="vehicle not moving",
        order=Order.SILENCE,
        order_suffices=True,
    ),
    Scenario(
        name="all-silent",
        sentence="The car sends nothing; the bridge still answers.",
        duration_s=10.0,
        alarm="connection lost",
        consequences=("signal stale",),
        effect=Silence,
    ),
    Scenario(
        name="bridge-frozen",
        sentence="The bridge keeps its connections but neither sends nor answers, as a stopped process.",
        duration_s=8.0,
        alarm="connection lost",
        bridge="freeze",
    ),
    Scenario(
        name="bridge-killed",
        sentence="The bridge drops every connection and refuses new ones, as a killed process.",
        duration_s=8.0,
        alarm="connection lost",
        bridge="kill",
    ),
    Scenario(
        name="manual-takeover",
        sentence="The safety driver brakes and takes the car over; the mode turns manual 0.2 s later.",
        duration_s=12.0,
        alarm="",
        order=Order.TAKE_OVER,
        order_suffices=True,
    ),
    Scenario(
        name="driver-brakes",
        sentence="The safety driver brakes against the controller; the mode stays autonomous.",
        duration_s=3.0,
        alarm="",
        order=Order.BRAKE,
        order_suffices=True,
    ),
    Scenario(
        name="mode-flaps",
        sentence="The mode topic flickers between autonomous and manual; the car drives itself on.",
        duration_s=8.0,
        alarm="",
        effect=faults.FlickeringMode,
    ),
)

SCENARIOS: dict[str, Scenario] = {scenario.name: scenario for scenario in _SCENARIOS}


class UnknownScenario(ValueError):
    """There is no scenario of that name, or its time is none; the text is one sentence for a person."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Planned:
    """A scenario to come: `after_s` after the beginning, for `duration_s` (None: its own duration)."""

    scenario: Scenario
    after_s: float = 0.0
    duration_s: float | None = None


def find(name: str) -> Scenario:
    """The scenario of that name, in any case of letters. Raises UnknownScenario."""
    found = SCENARIOS.get(name.strip().lower())
    if found is None:
        raise UnknownScenario(f"There is no scenario “{name.strip()[:40]}”. There are: {', '.join(SCENARIOS)}.")
    return found


def check_duration(duration_s: float) -> float:
    """The duration, if it is one. Raises UnknownScenario."""
    if not 0 < duration_s <= LONGEST_S:
        raise UnknownScenario(f"A scenario lasts more than 0 and at most {LONGEST_S:.0f} s, not {duration_s:g} s.")
    return duration_s


def planned(text: str) -> Planned:
    """Reads NAME, NAME@T or NAME@T+D: from T seconds after the beginning, for D seconds. Raises UnknownScenario."""
    name, at, when = text.partition("@")
    scenario = find(name)
    if not at:
        return Planned(scenario=scenario)
    match = re.fullmatch(r"(\d+(?:\.\d*)?)(?:\+(\d+(?:\.\d*)?))?", when.strip())
    if match is None:
        raise UnknownScenario(f"“{text[:60]}” is not NAME, NAME@SECONDS or NAME@SECONDS+DURATION.")
    duration_s = None if match[2] is None else check_duration(float(match[2]))
    return Planned(scenario=scenario, after_s=float(match[1]), duration_s=duration_s)


def inject(
    messages: Iterable[Message], faults: Iterable[Planned], signal_of: Callable[[Message], str | None]
) -> Iterator[Message]:
    """Lays faults over any messages, such as a recording; `after_s` counts from the first message.

    `signal_of` gives which signal a message carries. Faults of the bridge cannot happen in a recording and do nothing.
    """
    waiting = sorted(faults, key=lambda fault: fault.after_s)
    running: list[tuple[float, Effect]] = []
    began_s: float | None = None
    for message in messages:
        if began_s is None:
            began_s = message.at_s
        while waiting and message.at_s - began_s >= waiting[0].after_s:
            fault = waiting.pop(0)
            if fault.scenario.effect is not None:
                duration_s = fault.scenario.duration_s if fault.duration_s is None else fault.duration_s
                running.append((began_s + fault.after_s + duration_s, fault.scenario.effect()))
        for ends_s, effect in running:
            if message.at_s >= ends_s:
                effect.end()
        running = [(ends_s, effect) for ends_s, effect in running if not effect.is_over]
        yield from laid_over((message,), [effect for _, effect in running], signal_of(message))


def laid_over(messages: Iterable[Message], effects: Iterable[Effect], signal: str | None) -> list[Message]:
    """The messages, all of one signal, after every effect in turn."""
    left = list(messages)
    for effect in effects:
        left = [made for message in left for made in effect.apply(message, signal)]
    return left
