"""The unit of a signal is decided once for a drive: the right one, or unknown, and never changed back."""

from __future__ import annotations

import math
import pickle
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from monitor.checks.pedals import PedalLimits
from monitor.checks.pedals import find as find_pedals
from monitor.state import State
from server.judge import pipeline, profiles
from server.judge.profiles import GENERIC, Profile
from server.judge.reception_stats import Reception
from server.judge.sources.choice import choose
from server.judge.unit_watch import unit_questions, unit_sentences
from server.judge.units import PERCENT, RULES, SHARE, UNITS, rule_for, table, unit_named
from tests.tree import PROJECT

FLOAT, WRENCH, BATTERY = "std_msgs/Float32", "geometry_msgs/Wrench", "sensor_msgs/BatteryState"
TWIST, ODOMETRY, FIX = "geometry_msgs/Twist", "nav_msgs/Odometry", "sensor_msgs/NavSatFix"
TOPICS = {"brake": "/brake", "accelerator": "/throttle", "fuel": "/fuel", "steering": "/steering", "speed": "/speed"}
CATVEHICLE = profiles.load()["catvehicle"]


def message(type: str, signal: str, number: float) -> dict[str, Any]:
    if type == WRENCH:
        return {"force": {"x": number}, "torque": {"z": number}}
    if type == BATTERY:
        return {"present": True, "percentage": number}
    return {"linear": {"x": number}} if type == TWIST else {"data": number}


@dataclass
class Car:
    """What becomes of the messages of a car."""

    types: dict[str, str]  # by signal
    profile: Profile = GENERIC
    units: dict[str, str] = field(default_factory=dict)
    ratio: float = 0.0
    now_s: float = 0.0

    def __post_init__(self) -> None:
        offered = {TOPICS[name]: type for name, type in self.types.items() if name in TOPICS}
        offered |= {"/odom": ODOMETRY, "/fix": FIX}
        self.sources = choose(offered, {name: TOPICS[name] for name in self.types}).sources
        self.by_topic = pipeline.by_topic(self.sources.values())
        self.state, self.reception = State(), Reception()

    def send(self, topic: str, content: dict[str, Any]) -> None:
        pipeline.receive(
            self.by_topic[topic],
            content,
            self.now_s,
            None,
            reception=self.reception,
            state=self.state,
            profile=self.profile,
            tyre_rad_per_unit=self.ratio,
            units=self.units,
        )

    def say(self, signal: str, *numbers: float, every_s: float = 0.05) -> list[float | None]:
        """The headline number after each message; None: there is no reading."""
        found: list[float | None] = []
        for number in numbers:
            self.now_s += every_s
            self.send(TOPICS[signal], message(self.types[signal], signal, number))
            found.append(self.shown(signal))
        return found

    def shown(self, signal: str) -> float | None:
        reading = self.state.get(signal)
        if reading is None:
            return None
        for name in ("percent", "value", "speed_mps"):
            if hasattr(reading.value, name):
                return float(getattr(reading.value, name))
        raise AssertionError

    def unit(self, signal: str) -> str | None:
        decision = self.reception.units.decision(signal, TOPICS[signal])
        return None if decision is None or decision.unit is None else decision.unit.name

    def why(self, signal: str) -> str:
        decision = self.reception.units.decision(signal, TOPICS[signal])
        assert decision is not None
        return decision.why

    def questions(self) -> dict[str, list[str]]:
        found = unit_questions(self.reception.units, self.sources, self.units)
        return {one["signal"]: [option["value"] for option in one["options"]] for one in found}

    def drive(self, seconds: float, mps: float, factor: float, *, reference: str = "odom", hz: float = 20.0) -> None:
        """North at a steady speed, published times `factor`, with 10 places a second of the odometry or receiver."""
        every = max(1, round(hz / 10))
        for step in range(round(seconds * hz)):
            self.say("speed", mps * factor, every_s=1 / hz)
            if step % every == 0:
                way = mps * self.now_s
                if reference == "odom":
                    ahead = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
                    pose = {"position": {"x": way, "y": 0.0, "z": 0.0}, "orientation": ahead}
                    still = {"linear": {"x": 0.0, "y": 0.0}, "angular": {"z": 0.0}}
                    self.send("/odom", {"header": {}, "pose": {"pose": pose}, "twist": {"twist": still}})
                else:
                    fix = {"latitude": 48.2 + way / 111_195.0, "longitude": -110.5, "altitude": 1.0}
                    quality = {"position_covariance": [1.0] * 9, "position_covariance_type": 1}
                    self.send("/fix", {"status": {"status": 0}, **fix, **quality})


def test_the_page_of_the_signals_shows_every_rule() -> None:
    page = (PROJECT / "docs" / "signals.md").read_text(encoding="utf-8")
    assert table() in page


def test_every_signal_with_units_has_rules_and_every_unit_is_of_one() -> None:
    for signal, units in UNITS.items():
        rules = [rule for rule in RULES if signal in rule.signals]
        assert rules
        assert {unit.name for rule in rules for unit in rule.units} == {unit.name for unit in units}
    for profile in profiles.load().values():
        assert all(unit_named(signal, unit) for signal, unit in profile.units.items())


def test_a_profile_with_an_unknown_unit_is_refused() -> None:
    with pytest.raises(ValueError, match="brake has no unit 'psi'"):
        profiles._read("x", {"title": "x", "units": {"brake": "psi"}})


# -- values decide ---------------------------------------------------------------------------------------------------

VALUES: dict[str, tuple[str, str, list[float], list[float | None]]] = {
    "battery, share": ("fuel", BATTERY, [1.0, 0.5, 0.02], [100.0, 50.0, 2.0]),
    "battery, slightly over": ("fuel", BATTERY, [1.02, 0.9], [102.0, 90.0]),
    "battery, percent": ("fuel", BATTERY, [12.0, 0.6], [12.0, 0.6]),
    "battery, percent late": ("fuel", BATTERY, [0.9, 2.4, 0.9], [90.0, 2.4, 0.9]),
    "battery, percent by three values": ("fuel", BATTERY, [0.9, 1.4, 1.3, 1.2, 0.9], [90.0, None, None, 1.2, 0.9]),
    "battery, one wrong value": ("fuel", BATTERY, [0.9, 1.4, 0.5], [90.0, None, None]),
    "pedal of one, one wrong value": ("brake", FLOAT, [0.9, 1.3, 0.9], [None, None, None]),
    "battery, empty": ("fuel", BATTERY, [0.0], [0.0]),
    "battery, permille": ("fuel", BATTERY, [900.0, 80.0], [None, None]),
    "tank, percent": ("fuel", FLOAT, [30.0, 0.5], [30.0, 0.5]),
    "tank, open": ("fuel", FLOAT, [0.5, 0.4], [None, None]),
    "tank, open until above 1": ("fuel", FLOAT, [0.5, 3.0, 0.4], [None, 3.0, 0.4]),
    "tank, millilitres": ("fuel", FLOAT, [4000.0, 50.0], [None, None]),
    "pedal at rest": ("brake", FLOAT, [0.0, 0.0], [0.0, 0.0]),
    "pedal open": ("brake", FLOAT, [0.0, 0.3, 0.0], [0.0, None, None]),
    "pedal in percent, Nm or bar": ("brake", FLOAT, [0.0, 0.4, 3.0, 0.4], [0.0, None, None, None]),
    "pedal in Nm": ("brake", FLOAT, [60.0, 150.0, 60.0], [None, None, None]),
    "pedal below zero": ("brake", FLOAT, [-0.5, 0.5, 40.0], [None, None, None]),
    "wrench of any car": ("brake", WRENCH, [0.4, 3.0, 0.4], [None, None, None]),
    "accelerator up to 100": ("accelerator", FLOAT, [0.0, 60.0, 100.0], [0.0, None, None]),
    "steering, float": ("steering", FLOAT, [0.0, 0.1, 40.0], [0.0, None, None]),
    "steering, wrench": ("steering", WRENCH, [0.5, -20.0, 0.5], [None, None, None]),
    "steering, wrench of degrees": ("steering", WRENCH, [-20.0, 400.0, -20.0], [None, None, None]),
}


@pytest.mark.parametrize(("signal", "type", "numbers", "shown"), VALUES.values(), ids=VALUES)
def test_what_the_values_show(signal: str, type: str, numbers: list[float], shown: list[float | None]) -> None:
    found = Car({signal: type}).say(signal, *numbers)
    assert [one is None for one in found] == [one is None for one in shown]
    assert [one for one in found if one is not None] == pytest.approx([one for one in shown if one is not None])


@pytest.mark.parametrize("type", [FLOAT, WRENCH])
def test_the_catvehicle_has_percent_whatever_the_values_and_one_wrong_value_changes_nothing(type: str) -> None:
    car = Car({"brake": type}, profile=CATVEHICLE)
    assert car.say("brake", 0.4, 0.8, 150.0, 0.4) == pytest.approx([0.4, 0.8, 0.8, 0.4])
    assert car.reception.tally("brake").rejected == 1
    assert not car.questions()
    assert car.say("brake", 150.0, 150.0, 0.4)[-1] is None
    assert "as this kind of car has it, but values are beyond it" in car.why("brake")


@settings(deadline=None)
@given(
    st.sampled_from([("brake", FLOAT), ("accelerator", WRENCH), ("fuel", FLOAT), ("fuel", BATTERY)]),
    st.sampled_from([SHARE, PERCENT]),
    st.lists(st.floats(0.0, 1.0), min_size=1, max_size=60),
)
def test_a_drive_has_the_right_unit_or_none(kind: tuple[str, str], unit: Any, parts: list[float]) -> None:
    signal, type = kind
    car = Car({signal: type})
    numbers = [part * 100.0 / unit.factor for part in parts]
    decided: list[str] = []
    for number, shown in zip(numbers, car.say(signal, *numbers), strict=True):
        by_definition = type == BATTERY and max(numbers) <= SHARE.most  # what a share is then, though it is percent
        if shown is not None and not by_definition and (type != BATTERY or unit is SHARE):
            assert shown == pytest.approx(number * unit.factor, abs=0.51)
    for number in numbers:
        car.say(signal, number)
        decided.append(car.unit(signal) or "unknown")
    assert len(set(decided)) == 1
    if max(numbers) > SHARE.most:
        assert decided[0] == ("percent" if signal == "fuel" else "unknown")


@settings(deadline=None)
@given(st.lists(st.floats(-200.0, 200.0), max_size=80), st.sampled_from(["brake", "steering", "fuel"]))
def test_a_decision_never_changes_back(numbers: list[float], signal: str) -> None:
    car = Car({signal: FLOAT})
    seen: list[str] = []
    for number in numbers:
        car.say(signal, number)
        now = car.unit(signal) or "unknown"
        if not seen or seen[-1] != now:
            seen.append(now)
    assert len(seen) == len(set(seen)) or seen in (["unknown", "percent", "unknown"],)


def test_what_was_taken_for_a_share_is_void_once_it_is_percent() -> None:
    car = Car({"fuel": BATTERY})
    assert car.say("fuel", 0.9) == [90.0]
    assert car.say("fuel", 2.5) == [2.5]
    note = car.reception.units.note("fuel", "/fuel")
    assert note == "published in 0 to 100 %, by its values; what came before was taken as 0 to 1 and is void"


def test_a_pedal_of_unknown_unit_is_not_judged_by_an_older_value() -> None:
    car = Car({"brake": FLOAT, "accelerator": FLOAT})
    car.say("brake", 0.0)
    car.say("accelerator", 0.0)
    assert str(find_pedals(car.state.snapshot(car.now_s), PedalLimits(), False).verdict) == "ok"
    car.say("brake", 1.0)
    with pytest.raises(Exception, match="Brake: unit unknown: 0 to 1 or 0 to 100 %"):
        find_pedals(car.state.snapshot(car.now_s), PedalLimits(), False)


# -- two publishers --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("chosen", [None, "share", "percent"])
@pytest.mark.parametrize("pattern", [[0.3, 30.0], [0.3, 30.0, 30.0], [0.31, 30.0, 0.29, 30.4], [0.9, 90.0]])
def test_two_publishers_of_other_units_are_noticed(pattern: list[float], chosen: str | None) -> None:
    car = Car({"brake": FLOAT}, units={} if chosen is None else {"brake": chosen})
    car.say("brake", *(pattern * 8))
    assert car.say("brake", *pattern) == [None] * len(pattern)
    assert "two publishers" in car.why("brake") or chosen == "share"
    answers = ["percent", "nm", "bar"]
    assert car.questions() == ({"brake": answers} if chosen == "share" and "two" not in car.why("brake") else {})
    assert any("unit unknown" in sentence for sentence in unit_sentences(car.reception.units, car.sources))


def test_two_publishers_of_a_speed_are_noticed() -> None:
    car = Car({"speed": FLOAT})
    car.say("speed", *([5.0, 18.0] * 8))
    assert car.shown("speed") is None


@pytest.mark.parametrize(
    "numbers", [[0.4, 40.0, 0.4, 60.0], [0.0, 100.0], [0.39, 0.78, 20.0, 39.0, 78.0], [1.0, 3.6, 13.0]]
)
def test_a_driver_who_pumps_the_brake_is_one_publisher(numbers: list[float]) -> None:
    car = Car({"brake": FLOAT}, units={"brake": "percent"})
    quiet = [numbers[0]] * 20  # a second of rest between two strokes
    car.say("brake", *((numbers + quiet) * 10))
    assert car.unit("brake") == "percent"


# -- the operator ----------------------------------------------------------------------------------------------------


def test_both_pedals_down_alarm_once_the_operator_says_share() -> None:
    car = Car({"brake": FLOAT, "accelerator": FLOAT}, units={"brake": "share", "accelerator": "share"})
    assert car.say("brake", 1.0) == car.say("accelerator", 1.0) == [100.0]
    assert str(find_pedals(car.state.snapshot(car.now_s), PedalLimits(), False).verdict) == "fault"


def test_a_question_is_asked_once_the_car_moves_and_ends_with_the_answer() -> None:
    car = Car({"brake": FLOAT, "speed": TWIST})
    car.say("brake", 0.3)
    assert car.questions() == {}
    car.say("speed", 3.0)
    assert car.questions() == {"brake": ["share", "percent"]}
    assert (
        "Choose it in the file for --settings: [units] brake =" in unit_sentences(car.reception.units, car.sources)[0]
    )
    car.units = {"brake": "share"}
    assert car.questions() == {}
    assert car.say("brake", 0.3) == [30.0]
    assert car.questions() == {}


def test_nobody_is_asked_of_pedals_that_rest_or_have_a_unit() -> None:
    car = Car({"brake": FLOAT, "accelerator": FLOAT, "speed": TWIST, "fuel": BATTERY})
    car.say("speed", 3.0)
    car.say("brake", 0.0, 0.001)
    car.units = {"accelerator": "percent"}
    car.say("accelerator", 0.4, 20.0)
    car.say("fuel", 0.8)
    assert car.questions() == {}


def test_a_choice_that_the_values_contradict_is_not_believed() -> None:
    car = Car({"brake": FLOAT}, units={"brake": "share"})
    assert car.say("brake", 0.5, 30.0) == [50.0, 50.0]  # one wrong value is none
    assert car.say("brake", 30.0, 30.0, 0.5)[1:] == [None, None]
    assert car.why("brake") == "unit unknown: 0 to 1 as chosen, but values are beyond it"
    assert car.questions() == {"brake": ["percent", "nm", "bar"]}


@pytest.mark.parametrize("type", [FLOAT, WRENCH])
@pytest.mark.parametrize("signal", ["brake", "accelerator"])
@pytest.mark.parametrize("numbers", [[0.0, 12.0, 60.0, 100.0], [2.0] * 9, [1.1, 1.2, 1.3, 1.4], [0.4, 40.0, 99.9]])
def test_a_pedal_in_an_unknown_unit_up_to_100_is_asked_for(type: str, signal: str, numbers: list[float]) -> None:
    car = Car({signal: type, "speed": TWIST})
    assert [one for one in car.say(signal, *numbers) if one] == []
    car.say("speed", 3.0)
    assert car.questions() == {signal: ["percent", "nm", "bar"]}
    assert car.why(signal) == "unit unknown: 0 to 100 % or Nm or bar"
    car.units = {signal: "percent"}
    assert car.say(signal, *numbers) == pytest.approx(numbers)


@pytest.mark.parametrize(("unit", "label"), [("nm", "Nm"), ("bar", "bar")])
def test_a_brake_in_a_unit_that_cannot_be_converted_is_not_checked_and_nobody_is_asked(unit: str, label: str) -> None:
    car = Car({"brake": FLOAT, "accelerator": FLOAT, "speed": TWIST}, units={"accelerator": "percent"})
    car.say("accelerator", 80.0)
    car.say("speed", 3.0)
    car.say("brake", 0.0, 40.0)
    assert car.questions() == {"brake": ["percent", "nm", "bar"]}
    car.units |= {"brake": unit}
    assert car.say("brake", 0.0, 0.3, 40.0, 100.0, 180.0) == [None] * 5
    assert car.questions() == {}
    reason = f"in {label}, which cannot be converted to %"
    assert car.reception.units.note("brake", "/brake") == reason
    assert unit_sentences(car.reception.units, car.sources) == [f"Brake (/brake): {reason}. It is not evaluated."]
    with pytest.raises(Exception, match=f"Brake: {reason}"):
        find_pedals(car.state.snapshot(car.now_s), PedalLimits(), False)
    car.units |= {"brake": "percent"}
    assert car.say("brake", 40.0) == [40.0]
    assert car.reception.tally("brake").rejected == 0


def test_litres_are_shown_as_such_and_not_judged() -> None:
    car = Car({"fuel": FLOAT}, units={"fuel": "litres"})
    assert car.say("fuel", 40.0) == [40.0]
    reading = car.state.get("fuel")
    assert reading is not None
    assert reading.value.unit == "l"


STEERED: dict[str, tuple[str, float, float, float | None]] = {
    "percent": ("percent", 0.0, 20.0, None),
    "percent and ratio": ("percent", -0.00536, 20.0, -0.1072),
    "tyre in rad": ("tyre_rad", 0.0, 0.3, 0.3),
    "tyre in degrees": ("tyre_deg", 0.0, 30.0, math.radians(30.0)),
    "wheel in degrees": ("wheel_deg", 0.001, 300.0, 0.3),
    "wheel in rad": ("wheel_rad", 0.06, 5.0, 0.3),
}


@pytest.mark.parametrize(("unit", "ratio", "number", "tyre_rad"), STEERED.values(), ids=STEERED)
def test_a_chosen_unit_of_the_steering(unit: str, ratio: float, number: float, tyre_rad: float | None) -> None:
    car = Car({"steering": FLOAT}, units={"steering": unit}, ratio=ratio)
    car.say("steering", number)
    reading = car.state.get("steering")
    assert reading is not None
    assert reading.value.tyre_rad == (None if tyre_rad is None else pytest.approx(tyre_rad))


def test_a_steering_wheel_without_its_ratio_turns_no_tyre() -> None:
    car = Car({"steering": FLOAT}, units={"steering": "wheel_deg"})
    assert car.say("steering", 90.0) == [None]


def test_the_set_ratio_is_enough_for_a_steering() -> None:
    car = Car({"steering": FLOAT}, ratio=1.0)
    car.say("steering", 0.2)
    reading = car.state.get("steering")
    assert reading is not None
    assert reading.value.tyre_rad == pytest.approx(0.2)
    assert reading.value.percent == pytest.approx(-37.3, abs=0.1)


# -- speed -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("type", [FLOAT, TWIST])
@pytest.mark.parametrize("reference", ["odom", "fix"])
@pytest.mark.parametrize(("factor", "unit"), [(1.0, "mps"), (3.6, "kmh"), (3.5, "kmh"), (0.95, "mps")])
def test_the_way_decides_the_unit_of_a_speed(type: str, reference: str, factor: float, unit: str) -> None:
    car = Car({"speed": type})
    car.drive(8.0, 8.0, factor, reference=reference)
    assert car.unit("speed") == unit
    assert car.shown("speed") == pytest.approx(8.0 * factor / (3.6 if unit == "kmh" else 1.0))


@pytest.mark.parametrize(
    ("seconds", "mps", "factor"), [(2.0, 8.0, 3.6), (60.0, 1.8, 3.6), (20.0, 8.0, 2.0), (20.0, 8.0, 0.0)]
)
def test_a_short_slow_or_odd_way_decides_nothing(seconds: float, mps: float, factor: float) -> None:
    car = Car({"speed": TWIST})
    car.drive(seconds, mps, factor)
    assert car.why("speed") == "by convention (REP-103)"
    assert car.questions() == {}


def test_a_speed_that_changes_its_unit_has_none() -> None:
    car = Car({"speed": FLOAT})
    car.drive(8.0, 8.0, 1.0)
    car.drive(8.0, 8.0, 3.6)
    assert car.shown("speed") is None
    assert "m/s at one time and km/h at another" in car.why("speed")


def test_a_chosen_unit_of_a_speed_holds_at_once_and_is_contradicted_by_the_way() -> None:
    car = Car({"speed": FLOAT}, units={"speed": "kmh"})
    assert car.say("speed", 36.0) == [pytest.approx(10.0)]
    car.drive(8.0, 8.0, 1.0)
    assert car.shown("speed") is None
    assert car.questions() == {"speed": ["mps"]}


def test_the_fastest_car_is_bounded_in_its_own_unit() -> None:
    assert Car({"speed": FLOAT}).say("speed", 150.1) == [None]
    assert Car({"speed": FLOAT}, units={"speed": "kmh"}).say("speed", 539.0) == [pytest.approx(539.0 / 3.6)]


def test_what_was_received_in_the_wrong_unit_leaves_no_range() -> None:
    car = Car({"speed": FLOAT})
    car.drive(8.0, 8.0, 3.6)
    extent = car.state.snapshot(car.now_s).extents["speed"]
    assert (extent.lowest, extent.highest) == pytest.approx((8.0, 8.0))


# -- kept ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("numbers", [[0.3], [30.0, 0.3], [0.3, 30.0] * 3])
def test_a_decision_survives_a_checkpoint(numbers: Sequence[float]) -> None:
    car = Car({"brake": FLOAT})
    car.say("brake", *numbers)
    car.reception = pickle.loads(pickle.dumps(car.reception))
    other = Car({"brake": FLOAT})
    other.say("brake", *numbers)
    more = [0.3, 30.0, 0.3, 30.0]
    assert car.say("brake", *more) == other.say("brake", *more)
    assert car.unit("brake") == other.unit("brake")


def test_a_type_without_a_rule_has_that_of_a_number() -> None:
    assert rule_for("speed", ODOMETRY) is None
    assert rule_for("position", FIX) is None
    found = rule_for("brake", "some_msgs/Brake")
    assert found is not None
    assert found.definition is None
