"""A clock that is set while a recorder writes: times go on, whatever the container and wherever it is set."""

from __future__ import annotations

import random
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from server.recording.read.clock_steps import MOST_JUMPS, Arrivals, Jump, S, find_steps, returned
from server.recording.read.read import Recording, open_recording
from tests.server.recording.bags import BEGIN_S, Drive, Row, write_ros1, write_ros2
from tests.server.recording.stepped import CONTAINERS, LENGTH_S, Container, Step, rows, write

DAY_S = 86_400.0
NEAR_S = 0.1  # twice the interval of the wheels


def received(recording: Recording) -> list[tuple[float, str]]:
    return [(at_s - recording.start_s, topic) for at_s, topic, *_ in recording.rows()]


def true_times(**how: object) -> list[tuple[float, str]]:
    found = rows(2, **how)  # type: ignore[arg-type]
    return [(at_s - found[0][0], topic) for at_s, topic, *_ in found]


def assert_goes_on(path: Path, steps: list[Step], **how: object) -> None:
    """All messages come in the order of receipt, at their true times, with a note for each step."""
    with open_recording([path]) as recording:
        found, expected = received(recording), true_times(**how)
        assert [topic for _, topic in found] == [topic for _, topic in expected]
        late_s = NEAR_S * (1 + len(steps))
        assert all(abs(at_s - true_s) < late_s for (at_s, _), (true_s, _) in zip(found, expected, strict=True))
        assert [round(one.by_s) for one in recording.clock_steps] == [round(by_s) for _, by_s in steps]
        assert all(
            abs(one.at_s - after_s) < late_s for one, (after_s, _) in zip(recording.clock_steps, steps, strict=True)
        )


def random_steps(seed: int) -> list[Step]:
    """Up to four, each far from the others; steps ahead of less than a day are seen by the sensor's own clock only."""
    chance = random.Random(seed)
    moments = chance.sample(range(4, int(LENGTH_S) - 4, 6), chance.randint(1, 4))
    sizes = (-2.0, -7.0, -3600.0, -200 * DAY_S, 5.0, 90.0, 4 * 3600.0, 230 * DAY_S, 2 * DAY_S)
    return [(moment + chance.random(), chance.choice(sizes)) for moment in sorted(moments)]


@pytest.mark.parametrize("container", CONTAINERS)
@pytest.mark.parametrize("seed", range(3))
def test_times_go_on_over_steps_at_random_places(tmp_path: Path, container: Container, seed: int) -> None:
    steps = random_steps(10 * CONTAINERS.index(container) + seed)
    assert_goes_on(write(tmp_path, container, steps=steps), steps)


@pytest.mark.parametrize("container", CONTAINERS)
@pytest.mark.parametrize("by_s", [-3.0, -40 * DAY_S, 3 * DAY_S, 230 * DAY_S])
def test_no_sensor_with_a_clock_of_its_own_is_needed(tmp_path: Path, container: Container, by_s: float) -> None:
    steps = [(20.0, by_s)]
    assert_goes_on(write(tmp_path, container, steps=steps, has_own_clock=False), steps, has_own_clock=False)


THERE_AND_BACK: list[list[Step]] = [
    [(15.0, 300.0), (35.0, -300.0)],
    [(15.0, -300.0), (35.0, 300.0)],
    [(15.0, 20.0), (35.4, -20.3)],
    [(10.0, 120.0), (20.0, 240.0), (40.0, -360.0)],
    [(10.0, 700.0), (20.0, -300.0), (40.0, -400.0)],
    [(8.0, 60.0), (20.0, -60.0), (30.0, 3600.0), (50.0, -3600.0)],
    [(8.0, 600.0), (20.0, -30.0), (40.0, -600.0)],
]


@pytest.mark.parametrize(
    ("container", "steps"), [(CONTAINERS[n % len(CONTAINERS)], steps) for n, steps in enumerate(THERE_AND_BACK)]
)
def test_a_clock_that_is_set_ahead_and_back_again_gives_no_silence(
    tmp_path: Path, container: Container, steps: list[Step]
) -> None:
    """No sensor has a clock of its own: the steps show each other."""
    assert_goes_on(write(tmp_path, container, steps=steps, has_own_clock=False), steps, has_own_clock=False)


@pytest.mark.parametrize(("by_s", "silence_s"), [(-300.0, 250.0), (-300.0, 310.0), (-20.0, 21.5), (-3.0, 2.5)])
def test_a_silence_that_is_not_as_long_as_a_step_stays_one(tmp_path: Path, by_s: float, silence_s: float) -> None:
    path = write(tmp_path, "bag", steps=[(45.0 + silence_s, by_s)], silent_s=(20.0, silence_s), has_own_clock=False)
    with open_recording([path]) as recording:
        assert [round(one.by_s) for one in recording.clock_steps] == [round(by_s)]
        assert recording.duration_s == pytest.approx(LENGTH_S + silence_s, abs=0.3)


def test_silences_between_the_steps_stay_silences(tmp_path: Path) -> None:
    steps = [(15.0, 300.0), (85.0, -300.0)]
    path = write(tmp_path, "bag", steps=steps, silent_s=(30.0, 40.0), has_own_clock=False)
    assert_goes_on(path, steps, silent_s=(30.0, 40.0), has_own_clock=False)


@pytest.mark.parametrize("cuts_s", [(25.0,), (15.0,), (15.0, 35.0), (15.0, 25.0, 35.0)])
@pytest.mark.parametrize("by_s", [300.0, -300.0])
def test_the_clock_is_set_ahead_in_one_part_of_a_bag_and_back_in_another(
    tmp_path: Path, cuts_s: tuple[float, ...], by_s: float
) -> None:
    found, true = rows(2, [(15.0, by_s), (35.0, -by_s)], has_own_clock=False), true_times(has_own_clock=False)
    places = [0, *(sum(at_s < cut_s - 0.003 for at_s, _ in true) for cut_s in cuts_s), len(found)]
    folder = tmp_path / "drive"
    for number, (start, end) in enumerate(pairwise(places)):
        part = write_ros2(tmp_path / f"part{number}", Drive(messages=found[start:end]))
        if number == 0:
            part.rename(folder)
            text = (folder / "metadata.yaml").read_text()
            (folder / "metadata.yaml").write_text(text.replace("part0.mcap", "drive_0.mcap"))
            part = folder
        (part / f"part{number}.mcap").rename(folder / f"drive_{number}.mcap")
    with open_recording([folder]) as recording:
        times = received(recording)
        assert [topic for _, topic in times] == [topic for _, topic in true]
        assert all(abs(at_s - true_s) < 3 * NEAR_S for (at_s, _), (true_s, _) in zip(times, true, strict=True))
        assert [round(one.by_s) for one in recording.clock_steps] == [by_s, -by_s]


def jump(by_s: float, *, is_sure: bool = False) -> Jump:
    return Jump(0, round(by_s * S), is_sure or by_s < 0)


@pytest.mark.parametrize(
    ("jumps", "expected"),
    [
        ([jump(300), jump(-300)], {0}),
        ([jump(300), jump(-299.2)], {0}),
        ([jump(300), jump(-298)], set()),
        ([jump(40), jump(41), jump(-41)], {1}),
        ([jump(300, is_sure=True), jump(300), jump(-300)], set()),  # that one is taken back already
        ([jump(-300), jump(300), jump(300)], {1}),
        ([jump(40), jump(300), jump(30), jump(-300), jump(50)], {1}),
        ([jump(100), jump(200), jump(-300)], {0, 1}),
        ([jump(300), jump(300)], set()),
        ([jump(2.5), jump(-2.1)], set()),
    ],
)
def test_a_gap_is_a_step_where_another_step_takes_it_back(jumps: list[Jump], expected: set[int]) -> None:
    assert returned(jumps, 0) == expected


@pytest.mark.parametrize(("silence_s", "back_s"), [(4.0, 1.0), (6.0, 2.5), (9.0, 6.0), (2.5, 1.5), (3.0, 3.0)])
def test_where_messages_are_rare_a_silence_that_is_not_as_long_as_a_step_stays_one(
    silence_s: float, back_s: float
) -> None:
    """With a message a second."""
    assert not returned([jump(silence_s), jump(-back_s)], S)
    assert not returned([jump(-back_s), jump(silence_s)], S)


def test_where_messages_are_rare_a_step_is_taken_back() -> None:
    assert returned([jump(30.7), jump(-29.5)], S) == {0}
    assert returned([jump(301.0), jump(-299.2)], S) == {0}


def test_a_drive_with_thousands_of_gaps_is_compared_in_time() -> None:
    chance = random.Random(1)
    jumps = [jump(chance.uniform(2.0, 5000.0) * (-1 if n % 10 == 0 else 1)) for n in range(20_000)]
    assert max(returned(jumps, 0), default=0) < MOST_JUMPS


@pytest.mark.parametrize("container", CONTAINERS)
@pytest.mark.parametrize("has_own_clock", [True, False])
def test_a_clock_that_begins_in_1970_is_set(tmp_path: Path, container: Container, has_own_clock: bool) -> None:
    path = write(
        tmp_path, container, steps=[(0.0, 12.0 - BEGIN_S), (15.0, BEGIN_S - 12.0)], has_own_clock=has_own_clock
    )
    with open_recording([path]) as recording:
        assert recording.start_s == pytest.approx(BEGIN_S, abs=1.0)  # the later clock is the right one
        assert recording.duration_s == pytest.approx(LENGTH_S, abs=0.3)
        [step] = recording.clock_steps
        assert step.at_s == pytest.approx(15.0, abs=0.2)
        assert "53.9 years" in step.sentence


@pytest.mark.parametrize("container", CONTAINERS)
@pytest.mark.parametrize("silence_s", [30.0, 1200.0, 5 * 3600.0])
def test_a_silence_stays_one(tmp_path: Path, container: Container, silence_s: float) -> None:
    path = write(tmp_path, container, silent_s=(25.0, silence_s))
    with open_recording([path]) as recording:
        assert not recording.clock_steps
        assert recording.duration_s == pytest.approx(LENGTH_S + silence_s, abs=0.2)


def test_a_silence_during_which_the_clock_was_set_keeps_its_length(tmp_path: Path) -> None:
    path = write(tmp_path, "bag", steps=[(40.0, 300 * DAY_S)], silent_s=(25.0, 30.0))
    with open_recording([path]) as recording:
        assert len(recording.clock_steps) == 1
        assert recording.duration_s == pytest.approx(LENGTH_S + 30.0, abs=0.3)


def test_messages_that_waited_in_a_queue_are_a_silence(tmp_path: Path) -> None:
    """After an outage they come all at once: their stamps are of when they were sent."""
    found: list[Row] = []
    for at_s, topic, type, message in rows(1):
        late_s = 32.0 + (at_s - 20.0) / 60 if topic == "/imu" and 20.0 <= at_s < 32.0 else at_s
        if topic == "/imu" or not 20.0 <= at_s < 32.0:
            found.append((late_s, topic, type, message))
    path = write_ros1(tmp_path / "drive.bag", Drive(messages=sorted(found, key=lambda row: row[0])))
    with open_recording([path]) as recording:
        assert not recording.clock_steps
        times_s = [at_s for at_s, _ in received(recording)]
        assert max(b - a for a, b in pairwise(times_s)) == pytest.approx(12.0, abs=0.2)


@pytest.mark.parametrize("has_two_writers", [False, True])
def test_a_file_that_was_written_topic_by_topic_has_no_step(tmp_path: Path, has_two_writers: bool) -> None:
    found = sorted(rows(1), key=lambda row: row[1])
    if has_two_writers:
        found += [(at_s, "/imu", type, message) for at_s, topic, type, message in found if topic == "/imu"]
        found += [(at_s, "/last", type, message) for at_s, topic, type, message in found if topic == "/imu"]
    with open_recording([write_ros1(tmp_path / "drive.bag", Drive(messages=found))]) as recording:
        assert not recording.clock_steps
        assert recording.duration_s == pytest.approx(LENGTH_S, abs=0.2)


@pytest.mark.parametrize("topics", [("/twist",), ("/twist", "/fix", "/imu")])
@pytest.mark.parametrize("within_s", [2.0, LENGTH_S])
def test_a_file_that_was_written_in_no_order_has_no_step(
    tmp_path: Path, topics: tuple[str, ...], within_s: float
) -> None:
    chance = random.Random(7)
    true = [row for row in rows(2) if row[1] in topics]
    mixed = sorted(true, key=lambda row: row[0] + chance.uniform(0.0, within_s))
    with open_recording([write_ros2(tmp_path / "drive", Drive(messages=mixed))]) as recording:
        assert not recording.clock_steps
        assert [at_s for at_s, *_ in recording.rows()] == pytest.approx([BEGIN_S + row[0] for row in true])


@pytest.mark.parametrize("topics", [("/imu",), ("/twist", "/fix"), ("/twist", "/fix", "/imu")])
@pytest.mark.parametrize("within_s", [0.55, 0.65, 0.8])
@pytest.mark.parametrize("seed", range(3))
def test_messages_that_were_written_up_to_a_second_late_are_no_step(
    tmp_path: Path, topics: tuple[str, ...], within_s: float, seed: int
) -> None:
    chance = random.Random(seed)
    true = [row for row in rows(2) if row[1] in topics]
    mixed = sorted(true, key=lambda row: row[0] + chance.uniform(0.0, within_s))
    with open_recording([write_ros2(tmp_path / "drive", Drive(messages=mixed))]) as recording:
        assert not recording.clock_steps
        assert [at_s for at_s, *_ in recording.rows()] == pytest.approx([BEGIN_S + row[0] for row in true])


@pytest.mark.parametrize("late_s", [0.55, 0.9])
def test_one_message_that_was_written_late_is_no_step(tmp_path: Path, late_s: float) -> None:
    true = [row for row in rows(2) if row[1] == "/imu"]
    mixed = sorted(true, key=lambda row: row[0] + (late_s if row is true[500] else 0.0))
    with open_recording([write_ros2(tmp_path / "drive", Drive(messages=mixed))]) as recording:
        assert not recording.clock_steps


@pytest.mark.parametrize("by_s", [-1.0, -2.0, -30.0])
@pytest.mark.parametrize("topic", ["/imu", "/twist", "/fix"])
@pytest.mark.parametrize("within_s", [0.0, 0.7])
def test_a_step_of_a_second_is_found_among_late_messages_too(
    tmp_path: Path, by_s: float, topic: str, within_s: float
) -> None:
    chance = random.Random(3)
    true = [row for row in rows(2) if row[1] == topic]
    mixed = sorted(true, key=lambda row: row[0] + chance.uniform(0.0, within_s))
    stepped = [(row[0] + (by_s if number > len(mixed) // 2 else 0.0), *row[1:]) for number, row in enumerate(mixed)]
    with open_recording([write_ros2(tmp_path / "drive", Drive(messages=stepped))]) as recording:
        assert [one.by_s for one in recording.clock_steps] == [pytest.approx(by_s, abs=1.0)]


def test_a_step_of_a_second_is_found_where_messages_before_it_were_late() -> None:
    late = (1000, 1030, 1060)
    order = sorted(range(2000), key=lambda number: number + (30 if number in late else 0))
    times_ns = np.array([BEGIN_S * S + number * S // 50 - (S if number > 1100 else 0) for number in order])
    arrivals = Arrivals(places=np.arange(2000), times_ns=times_ns, channels=np.zeros(2000, np.int64))
    found = find_steps(lambda: iter([arrivals]), lambda *_: None)
    assert [one.place for one in found.stretches] == [0, 1101]
    times_ns[1101:] += S
    assert not find_steps(lambda: iter([arrivals]), lambda *_: None).stretches


def test_a_clock_that_is_set_three_times_as_a_slow_recording_begins_is_no_lack_of_order(tmp_path: Path) -> None:
    """From 1970 to the date of a clock with a battery, to that of the network, and back by 4 s."""
    slow = [row for row in rows(2) if row[1] == "/twist"][::10]
    ahead_s = [-BEGIN_S] * 5 + [-40 * DAY_S] * 8 + [4.0] * 8 + [0.0] * len(slow)
    mixed = [(row[0] + by_s, *row[1:]) for row, by_s in zip(slow, ahead_s, strict=False)]
    with open_recording([write_ros2(tmp_path / "drive", Drive(messages=mixed))]) as recording:
        assert recording.clock_steps
        assert recording.duration_s < 2 * LENGTH_S


def test_a_seek_begins_at_a_corrected_time(tmp_path: Path) -> None:
    for container in CONTAINERS:
        path = write(tmp_path / container, container, steps=[(20.0, -50.0), (40.0, 230 * DAY_S)])
        with open_recording([path]) as recording:
            every = [row[:2] for row in recording.rows()]
            for start_s in (10.0, 19.9, 25.0, 45.0):
                expected = [row for row in every if row[0] >= recording.start_s + start_s - 1e-6]
                assert [row[:2] for row in recording.rows(start_s)] == expected


def test_parts_of_a_split_bag_follow_each_other_where_the_clock_was_set_between_them(tmp_path: Path) -> None:
    folder = tmp_path / "drive"
    found = rows(2, steps=[(30.0, -500.0)])
    middle = len(rows(2)) // 2
    first = write_ros2(tmp_path / "a", Drive(messages=found[:middle]))
    second = write_ros2(tmp_path / "b", Drive(messages=found[middle:]))
    first.rename(folder)
    (folder / "a.mcap").rename(folder / "drive_0.mcap")
    (second / "b.mcap").rename(folder / "drive_1.mcap")
    text = (folder / "metadata.yaml").read_text()
    (folder / "metadata.yaml").write_text(text.replace("a.mcap", "drive_0.mcap"))
    with open_recording([folder]) as recording:
        times = received(recording)
        assert len(times) == len(found)
        assert [topic for _, topic in times] == [topic for _, topic in true_times()]
        [step] = recording.clock_steps
        assert step.by_s == pytest.approx(-500.0, abs=0.2)


def test_a_clock_that_is_set_again_and_again_fills_no_page_with_notes(tmp_path: Path) -> None:
    steps = [(2.0 + 3.5 * number, -4.0) for number in range(16)]
    with open_recording([write(tmp_path, "bag", steps=steps)]) as recording:
        assert len(recording.clock_steps) == 16
        assert recording.duration_s == pytest.approx(LENGTH_S, abs=1.0)
        assert len(recording.clock_notes) == 11
        assert recording.clock_notes[-1] == "The recorder's clock was set 6 more times."
