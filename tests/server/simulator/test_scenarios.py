"""Every scenario in the simulated car: it breaks its own rule, in time, and no other; afterwards all is well again."""

from __future__ import annotations

import itertools

import pytest

from server.simulator.car import START_S, SimulatedCar
from server.simulator.effects import Speeding
from server.simulator.scenario import Scenario
from server.simulator.scenarios import SCENARIOS, Planned, UnknownScenario, find, planned
from tests.server.simulator.rules import Rules

NAMES = [
    "speeding", "obstacle", "near-object", "command-ignored", "standing", "pedal-conflict", "gps-drift", "gps-jump",
    "phone-mismatch", "stale-gps", "no-fix", "silent-scan", "blind-laser", "frozen-speed", "short-scan",
    "frozen-position", "frozen-scan", "slow-rate", "all-slow", "clock-jump", "clock-slow", "diagnostics-error",
    "diagnostics-warning", "controller-silent", "all-silent", "bridge-frozen", "bridge-killed",
    "manual-takeover", "driver-brakes", "mode-flaps",
]  # fmt: skip

# What tests/server/judge/test_judged.py judges in the long run only: scenario → (rules that must be broken, within so
# many seconds; rules that may be)
EXPECTED: dict[str, tuple[dict[str, float], set[str]]] = {
    "speeding": ({"speed": 8.0}, set()),
    "gps-drift": ({"gps drift": 15.0}, {"gps wander", "not moving"}),
}

BEGINS_S = 7.0  # in the wide bend


def broken(name: str, after_s: float, until_s: float) -> dict[str, list[float]]:
    car = SimulatedCar(plan=(Planned(scenario=find(name), after_s=after_s),))
    # a quick reaction, so that the driver's own margin cannot hide a fault
    return Rules(reaction_s=0.5).run(car.messages(), until_s=until_s).broken


def test_the_names_are_the_promised_ones() -> None:
    assert list(SCENARIOS) == NAMES


@pytest.mark.parametrize("scenario", SCENARIOS.values(), ids=lambda scenario: scenario.name)
def test_each_is_explained_and_does_something(scenario: Scenario) -> None:
    assert scenario.sentence.endswith(".")
    assert scenario.sentence[0].isupper()
    assert len(scenario.sentence) <= 110
    assert 1.0 <= scenario.duration_s <= 120.0
    assert scenario.alarm or scenario.name in ("manual-takeover", "driver-brakes", "mode-flaps")
    if scenario.order_suffices:
        assert scenario.order is not None
    else:
        assert (scenario.effect is not None) != (scenario.bridge is not None)


@pytest.mark.parametrize("name", EXPECTED)
def test_a_scenario_breaks_its_own_rule_in_time_and_no_other(name: str) -> None:
    must, may = EXPECTED[name]
    after_s = BEGINS_S
    found = broken(name, after_s, until_s=after_s + find(name).duration_s + 20)
    assert set(found) - may == set(must)
    for rule, within_s in must.items():
        times = found[rule]
        assert after_s - 0.1 <= times[0] <= after_s + within_s
        assert times[-1] <= after_s + find(name).duration_s + 6.0
        assert max(b - a for a, b in itertools.pairwise(times)) < 2.5, "it must break its rule once"


@pytest.mark.slow
def test_speeding_happens_once_wherever_it_begins() -> None:
    """Before the notch there is no room to speed long: that must not make two alarms of one scenario."""
    for after_s in (20.0, 22.5, 25.0):
        times = broken("speeding", after_s, until_s=after_s + 75)["speed"]
        assert times[0] < after_s + 45
        assert max(b - a for a, b in itertools.pairwise(times)) < 1.0


def test_a_silent_car_is_silent_on_every_topic() -> None:
    """Ten seconds without a message; the bridge and what answers there are not the car's."""
    car = SimulatedCar(plan=(planned("all-silent@3+10"),))
    times = []
    for message in car.messages():
        if message.at_s > START_S + 20:
            break
        times.append(message.at_s - START_S)
    gap = max(itertools.pairwise(times), key=lambda pair: pair[1] - pair[0])
    assert gap[0] == pytest.approx(3.0, abs=0.03)
    assert gap[1] == pytest.approx(13.0, abs=0.03)


def test_a_phone_mismatch_moves_the_car_far_enough_and_breaks_nothing_else() -> None:
    car = SimulatedCar(plan=(planned("phone-mismatch@7"),))
    rules, farthest_m, last_m = Rules(reaction_s=0.5), 0.0, 0.0
    for message in car.messages():
        if message.at_s > START_S + 140:
            break
        rules.take(message)
        if message.topic == "/gps_fix":
            truth = car.state()["truth"]
            last_m = (
                ((message.message["latitude"] - truth["lat_deg"]) * 110_891) ** 2
                + ((message.message["longitude"] - truth["lon_deg"]) * 94_256) ** 2
            ) ** 0.5
            farthest_m = max(farthest_m, last_m)
    assert rules.broken == {}
    assert 58.0 < farthest_m < 63.0
    assert last_m < 2.0


def test_the_obstacle_is_met_by_braking_and_the_drive_goes_on() -> None:
    car = SimulatedCar(plan=(planned("obstacle@11"),))
    steps = car.steps()
    nearest_m, slowest_mps, last_m = 99.0, 99.0, 0.0
    while car.elapsed_s < 35:
        for message in next(steps).messages:
            if message.topic == "/DistanceEstimator/dist" and car.elapsed_s < 21.5:
                last_m = message.message["data"]
                if 11.1 < car.elapsed_s < 20.9:
                    nearest_m = min(nearest_m, last_m)
        if 11.1 < car.elapsed_s < 20.9:
            slowest_mps = min(slowest_mps, car.motion.speed_mps)
    assert slowest_mps == 0.0
    assert 3.5 < nearest_m < 4.9
    assert last_m > 40.0  # it is gone as suddenly
    assert car.motion.speed_mps > 5.0


def test_speeding_is_true_motion_in_the_car() -> None:
    car = SimulatedCar(plan=(planned("speeding@7"),))
    steps = car.steps()
    fastest_mps = 0.0
    while car.elapsed_s < 20:
        next(steps)
        fastest_mps = max(fastest_mps, car.motion.speed_mps)
    assert 11.5 < fastest_mps < Speeding.REACHED_MPS


@pytest.mark.parametrize(("name", "fault"), [("bridge-frozen", "freeze"), ("bridge-killed", "kill")])
def test_faults_of_the_bridge_are_told_step_by_step(name: str, fault: str) -> None:
    car = SimulatedCar(plan=(planned(f"{name}@2+3"),))
    suffering = []
    for step in car.steps():
        if car.elapsed_s > 8:
            break
        assert step.messages, "the car itself drives on"
        if step.bridge_faults:
            assert step.bridge_faults == {fault}
            suffering.append(car.elapsed_s)
    assert suffering[0] == pytest.approx(2.0, abs=0.03)
    assert suffering[-1] == pytest.approx(5.0, abs=0.03)


def states(car: SimulatedCar) -> dict[str, str]:
    return {row["name"]: row["state"] for row in car.state()["scenarios"] if row["state"] != "off"}


def test_scenarios_run_side_by_side_and_end_by_themselves_or_when_stopped() -> None:
    car = SimulatedCar(plan=(planned("slow-rate@1+4"),))
    steps = car.steps()

    def drive_until(elapsed_s: float) -> None:
        while car.elapsed_s < elapsed_s:
            next(steps)

    drive_until(0.5)
    assert states(car) == {}
    drive_until(2.0)
    car.start(find("silent-scan"))
    car.start(find("pedal-conflict"), 60.0)
    drive_until(3.0)
    assert states(car) == {"slow-rate": "running", "silent-scan": "running", "pedal-conflict": "running"}
    left_s = {row["name"]: row["left_s"] for row in car.state()["scenarios"]}
    assert left_s["pedal-conflict"] == pytest.approx(59.0, abs=0.1)
    drive_until(5.2)
    assert states(car) == {"silent-scan": "running", "pedal-conflict": "running"}
    car.stop("silent-scan")
    drive_until(5.3)
    assert states(car) == {"pedal-conflict": "running"}
    car.stop()
    drive_until(5.4)
    assert states(car) == {}


def test_starting_what_runs_already_gives_it_new_time() -> None:
    car = SimulatedCar(plan=(planned("stale-gps@1+2"),))
    steps = car.steps()
    while car.elapsed_s < 2.5:
        next(steps)
    car.start(find("stale-gps"), 4.0)
    while car.elapsed_s < 6.0:
        next(steps)
    assert states(car) == {"stale-gps": "running"}
    while car.elapsed_s < 6.7:
        next(steps)
    assert states(car) == {}


@pytest.mark.parametrize(
    ("text", "after_s", "duration_s"),
    [
        ("speeding", 0.0, None),
        ("SPEEDING@0", 0.0, None),
        ("gps-jump@12.5", 12.5, None),
        ("gps-jump@12.5+3", 12.5, 3.0),
        (" blind-laser @ 1+0.5", 1.0, 0.5),
    ],
)
def test_plans_are_read(text: str, after_s: float, duration_s: float | None) -> None:
    plan = planned(text)
    assert (plan.after_s, plan.duration_s) == (after_s, duration_s)
    assert plan.scenario.name in text.lower()


@pytest.mark.parametrize(
    "text",
    ["", "nope", "speeding@", "speeding@x", "speeding@-1", "speeding@1+", "speeding@1+0", "speeding@1+1e9", "@3"],
)
def test_plans_that_cannot_be_read_are_refused_with_a_sentence(text: str) -> None:
    with pytest.raises(UnknownScenario) as refusal:
        planned(text)
    assert str(refusal.value).endswith(".")
