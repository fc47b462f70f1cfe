"""Walks every check there is: nothing the page, the settings or the operator needs may be missing from one."""

from __future__ import annotations

import inspect

import pytest
from pydantic import ValidationError

from monitor import catalog
from monitor.alarm_spec import Action, Place, Priority, Sound
from monitor.catalog import CHECKS, AllLimits, AnyCheck
from monitor.check import OK, Check, Limits, Scope, threshold
from monitor.checks.signal_slow import expected_rates
from monitor.runner import IMPAIRED_SPEC, Monitor
from monitor.signals import SIGNALS
from tests.monitor.test_alarm import SPEC

SPECS = {**{check.id: check.alarm for check in CHECKS}, "monitoring_impaired": IMPAIRED_SPEC}
# What fits a phone of 360 px: the head of a dialog, the line of a snackbar, a row of the list.
LETTERS = {Place.DIALOG: 26, Place.SNACKBAR: 36, Place.LIST: 36}


def every_check(test):  # type: ignore[no-untyped-def]
    return pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.id)(test)


def test_each_signal_has_its_own_alarms() -> None:
    ids = {check.id for check in CHECKS}
    assert {f"signal_{kind}.{name}" for kind in ("stale", "slow") for name in SIGNALS} <= ids
    assert {"speed_limit", "connect_failed", "no_message", "link_lost", "car_silent"} <= ids


def test_each_check_states_when_it_is_checked() -> None:
    for check in CHECKS:
        assert check.checked_when.endswith("."), check.id
        assert check.checked_when.startswith(("Checked ", "Always checked")), check.id


@pytest.mark.parametrize(("alarm_id", "spec"), SPECS.items(), ids=SPECS.keys())
def test_what_an_alarm_must_have(alarm_id: str, spec) -> None:  # type: ignore[no-untyped-def]
    assert 0 < len(spec.title) <= LETTERS[spec.place]
    assert spec.title[0].isupper()
    assert not spec.title.endswith(".")
    assert spec.advice.endswith("."), "the advice to the operator is a sentence"
    assert spec.on_delay_s >= 0.0
    assert spec.off_delay_s >= 0.0
    if spec.priority is Priority.CRITICAL:
        assert spec.place is Place.DIALOG
        assert spec.sound is Sound.HIGH
        assert spec.needs_ack
    if spec.needs_ack and spec.place_after is not Place.LIST:
        assert Action.ACKNOWLEDGE in spec.actions
    if Action.SHELVE in spec.actions:
        assert spec.shelvable
        assert not any(alarm_id in other.inhibited_by for other in SPECS.values()), "what explains others is not"
    if spec.place is Place.SNACKBAR:
        assert spec.sound is not Sound.HIGH


@every_check
def test_what_a_check_must_have(check: AnyCheck) -> None:
    assert check.label
    assert check.needs <= SIGNALS.keys()
    assert len(check.tile_label) <= 12, "a third of a phone"
    assert list(inspect.signature(check.find).parameters)[-3:] == ["snapshot", "limits", "was_active"]


EXPLAIN_MESSAGES = ("link_lost", "link_late", "link_late_moving", "car_silent", "car_unusable", "no_message")


@every_check
def test_only_what_explains_missing_messages_has_a_grace(check: AnyCheck) -> None:
    """A grace delays what is explained; what is judged by values must be reported at once when it is seen again."""
    explains_messages = check.id in EXPLAIN_MESSAGES or check.id.startswith(("signal_stale.", "signal_unusable."))
    assert (check.alarm.grace_s > 0.0) == explains_messages


OF_THE_LINK = ("connect_failed", "no_message", "link_lost", "link_late", "link_late_moving", "bridge_fault")


@every_check
def test_a_check_of_the_link_is_not_blinded_by_it(check: AnyCheck) -> None:
    assert (check.scope is Scope.LINK) == (check.id in OF_THE_LINK)


def test_a_group_of_thresholds_is_one_class() -> None:
    limits = Monitor(limits=AllLimits()).limits
    for check in CHECKS:
        if check.limits.model_fields:
            assert type(getattr(limits, check.limits_group)) is check.limits


@pytest.mark.parametrize(("name", "field"), catalog.schema().items(), ids=catalog.schema().keys())
def test_a_threshold_has_all_that_settings_need(name: str, field: dict[str, object]) -> None:
    assert field["title"]
    assert field["type"] == "number"
    assert isinstance(field["unit"], str)
    assert field["unit"]
    assert field["heading"]
    low, default, high = field["minimum"], field["default"], field["maximum"]
    assert isinstance(low, float)
    assert isinstance(default, float)
    assert isinstance(high, float)
    assert low <= default <= high
    assert low < high


def test_settings_begin_with_the_first_tile_and_headings_stand_together() -> None:
    headings = [field["heading"] for field in catalog.schema().values()]
    assert headings[0] == "Speed"
    assert headings[-1] == "Expert", "what is seldom changed is the last"
    assert list(dict.fromkeys(headings))[-2] == "Gauge"
    assert {name for name, field in catalog.schema().items() if field["heading"] == "Vehicle"} == {
        "obstacle.half_width_m", "obstacle.wheelbase_m", "obstacle.laser_ahead_m", "obstacle.bumper_ahead_m",
        "mounting.yaw_deg", "mounting.left_m", "mounting.upside_down", "mounting.by_settings",
        "steering.tyre_rad_per_unit",
    }  # fmt: skip


def test_no_two_thresholds_read_alike() -> None:
    titles = [field["title"] for field in catalog.schema().values()]
    assert len(titles) == len(set(titles))


def test_the_flat_names_are_those_of_the_schema() -> None:
    assert catalog.flat(AllLimits()).keys() == catalog.schema().keys()
    assert catalog.flat(AllLimits())["speed_limit.max_mps"] == 11.0


def test_thresholds_are_changed_by_their_full_name() -> None:
    limits = catalog.changed(AllLimits(), {"speed_limit.max_mps": 5, "signals.scan_hz": 30.0})
    assert catalog.flat(limits)["speed_limit.max_mps"] == 5.0
    assert catalog.flat(limits)["speed_limit.deadband_mps"] == 0.5
    assert expected_rates(limits) == {"scan": 30.0}
    assert catalog.flat(AllLimits())["speed_limit.max_mps"] == 11.0


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("speed_limit.max_mps", 0.4),
        ("speed_limit.max_mps", 40.1),
        ("speed_limit.max_mps", float("nan")),
        ("speed_limit.max_mps", float("inf")),
        ("speed_limit.max_mps", "5"),
        ("speed_limit.max_mps", True),
        ("speed_limit.max_mps", None),
        ("speed_limit.min_mps", 1.0),
        ("warp.factor", 9.0),
        ("speed_limit", 5.0),
    ],
)
def test_what_is_no_threshold_or_no_value_is_refused_by_name(name: str, value: object) -> None:
    with pytest.raises(ValidationError) as refused:
        catalog.changed(AllLimits(), {name: value})
    located = ".".join(str(part) for part in refused.value.errors()[0]["loc"])
    assert name.startswith(located.rstrip("."))


@pytest.mark.parametrize("value", [0.5, 40.0])
def test_the_ends_of_a_range_belong_to_it(value: float) -> None:
    assert catalog.flat(catalog.changed(AllLimits(), {"speed_limit.max_mps": value}))["speed_limit.max_mps"] == value


def test_thresholds_cannot_be_written_past_their_validation() -> None:
    with pytest.raises(ValidationError):
        AllLimits().speed_limit.max_mps = 99.0


class OtherLimits(Limits):
    much: float = threshold(1.0, "Much", unit="m", low=0.0, high=2.0)


def test_two_families_cannot_share_a_name() -> None:
    first = Check(id="a", label="A", alarm=SPEC, limits=OtherLimits, find=lambda *_: OK, group="gauge")
    with pytest.raises(ValueError, match="two classes of limits are named gauge"):
        catalog.compose((first,))


def test_a_default_outside_its_range_is_no_threshold() -> None:
    class Wrong(Limits):
        much: float = threshold(3.0, "Much", unit="m", low=0.0, high=2.0)

    with pytest.raises(ValidationError):
        Wrong()
