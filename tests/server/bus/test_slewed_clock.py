"""What an agent whose clock was slewed sends unasked behind a gap: no node takes a state for younger than it is."""

from __future__ import annotations

import base64
import random
from collections.abc import Iterator
from typing import Any

import pytest

from server.bus import nats_wire as wire
from server.bus.journal import Journal
from server.bus.local import LocalBus
from server.bus.nats_agent_frames import MOST_FIRST, MOST_RETURNS, SentFrames
from server.bus.nats_clock import AgentAhead, Steady

STATE = random.Random(1).randbytes(2000).hex()
GAP = (60.0, 90.0)
READ_S = 0.001


async def nothing(_: Any) -> dict[str, Any]:
    return {}


class Node:
    """Of one vehicle, pulled without delay: its bound of the agent's clock is as low as one can be."""

    def __init__(self, vehicle: str) -> None:
        self.vehicle = vehicle
        self.ahead = AgentAhead(Steady(lambda: 0.0))
        self.number = 0
        self.texts = wire.Bases()


class Agent:
    """Its clock is slewed by `rate` between two moments. `t` is the true time [s]."""

    def __init__(self, rate: float, from_s: float, to_s: float) -> None:
        self.t = 0.0
        self._slew = (rate, from_s, to_s)
        self._made = 0
        self.bus = LocalBus(Journal(None), now=self.now)
        for vehicle in ("ocelot", "margay"):
            self.bus.serve(vehicle, nothing)
        self.frames = SentFrames(self.bus, "a", self.now, self.slewed_s)

    def slewed_s(self) -> float:
        rate, from_s, to_s = self._slew
        return rate * (min(max(self.t, from_s), to_s) - from_s)

    def now(self) -> float:
        return 1000.0 + self.t + self.slewed_s()

    def pull(self, node: Node, *, is_answer_lost: bool = False, is_new: bool = True) -> None:
        """The node pulls, and gets a new state, or the one that another node got."""
        pull = wire.Pull(have=node.number, run="a", inflates=True, is_base=node.number > 0)
        self.frames.note_pull(node.vehicle, "state", pull)
        if is_answer_lost:
            return
        if is_new or self.bus.newest(node.vehicle, "state") is None:
            self._made += 1
            self.bus.put(node.vehicle, "state", f"{STATE}{self._made}")
        frame = self.bus.newest(node.vehicle, "state")
        assert frame is not None
        self.frames.compressed(node.vehicle, "state", self.frames.encoded(self.now(), frame), frame, pull)
        node.ahead.answered(self.t, self.now(), self.t)
        node.number = frame.number
        node.texts.add(frame.number, str(frame.payload))

    def unasked(self, nodes: list[Node]) -> Iterator[tuple[Node, float]]:
        """Behind the gap: who takes a state, and by how much it takes it for older than it is [s]."""
        self.t = GAP[1]
        yield from self.behind(nodes)

    def behind(self, nodes: list[Node]) -> Iterator[tuple[Node, float]]:
        self.frames.begin_first()
        yield from self.first_states(nodes)

    def first_states(self, nodes: list[Node]) -> Iterator[tuple[Node, float]]:
        for vehicle in ("ocelot", "margay"):
            self._made += 1
            self.bus.put(vehicle, "state", f"{STATE}{self._made}")
            here = self.frames.announcement(vehicle, 2, is_first=True)
            for node in nodes:
                if node.vehicle == vehicle and here.state and (base := node.texts.get(here.base)):
                    head, payload = wire.decode_frame(base64.b64decode(here.state), base)
                    node.number = head.number
                    node.texts.add(head.number, str(payload))
                    yield node, self.t - (node.ahead.earliest(head.now_s, self.t) - head.age_s)


@pytest.mark.parametrize("rate", [0.083, -0.083])
@pytest.mark.parametrize("until_s", [30.0, 58.0])
async def test_of_several_vehicles_one_that_was_not_pulled_up_to_the_gap(until_s: float, rate: float) -> None:
    agent = Agent(rate, until_s, GAP[0] - 1)
    ocelot, margay = nodes = [Node("ocelot"), Node("margay")]
    while agent.t < GAP[0]:
        agent.t += 0.5
        agent.pull(ocelot)
        if agent.t <= until_s:
            agent.pull(margay)
    found = dict(agent.unasked(nodes))
    assert ocelot in found, "one that was pulled up to the gap has its states at once"
    assert min(found.values()) >= -READ_S


@pytest.mark.parametrize("rate", [0.083, -0.083])
async def test_of_several_nodes_one_whose_answers_were_lost_before_the_gap(rate: float) -> None:
    agent = Agent(rate, 58.0, GAP[0])
    nodes = [Node("ocelot"), Node("ocelot")]
    while agent.t < GAP[0]:
        agent.t += 0.5
        for node in nodes:
            agent.pull(node, is_answer_lost=agent.t > 58.0)
    assert all(older_s >= -READ_S for _, older_s in agent.unasked(nodes))


async def test_of_several_nodes_one_that_had_a_state_long_before_another_had_it() -> None:
    agent = Agent(0.083, 58.1, 59.6)
    early, late = nodes = [Node("ocelot"), Node("ocelot")]
    while agent.t < 58.0:
        agent.t += 0.5
        agent.pull(late)
        agent.pull(early)
    agent.t = 59.7
    agent.pull(late, is_new=False)
    agent.pull(late, is_answer_lost=True)
    assert early.number == late.number
    assert all(older_s >= -READ_S for _, older_s in agent.unasked(nodes))


async def test_behind_gaps_in_a_row_the_clock_counts_from_the_last_answer() -> None:
    agent = Agent(0.00244, 60.0, 120.0)
    node = Node("ocelot")
    while agent.t < 60.0:
        agent.t += 0.5
        agent.pull(node)
    found = []
    for _ in range(5):
        agent.t += 5.0
        found += [older_s for _, older_s in agent.behind([node])]
        agent.pull(node, is_answer_lost=True)
    assert found, "the first gaps are short enough for a clock that is slewed so little"
    assert min(found) >= -READ_S


@pytest.mark.parametrize("rate", [0.083, -0.083])
@pytest.mark.parametrize("slewed_s", [0.1, 0.3])
@pytest.mark.parametrize("first_gap_s", [30.0, 590.0])
async def test_behind_a_long_gap_and_one_that_begins_at_once(first_gap_s: float, slewed_s: float, rate: float) -> None:
    """A state that was sent unasked behind the first one has the clock of before it, which drifts for long."""
    agent = Agent(rate, 70.0 + first_gap_s, 70.0 + first_gap_s + slewed_s / 0.083)
    node = Node("ocelot")
    while agent.t < 60.0:
        agent.t += 0.5
        agent.pull(node)
    agent.t += first_gap_s
    agent.frames.begin_first()
    for _ in range(10):
        agent.t += 0.1
        assert [*agent.first_states([node])]
        agent.pull(node, is_new=False)
    agent.t += 30.0
    assert all(older_s >= -READ_S for _, older_s in agent.behind([node]))


async def test_none_goes_unasked_behind_more_gaps_in_a_row_than_are_kept() -> None:
    agent = Agent(0.0, 0.0, 1.0)
    node = Node("ocelot")
    agent.pull(node)
    agent.pull(node)
    for _ in range(MOST_RETURNS - 1):
        agent.t += 0.3
        assert [*agent.behind([node])]
    agent.t += 0.3
    assert not [*agent.behind([node])]


@pytest.mark.parametrize("seed", range(30))
async def test_beside_answers_of_which_some_are_lost(seed: int) -> None:
    chance = random.Random(seed)
    from_s = chance.uniform(GAP[0] - 2.0, GAP[1] + 2.0)
    agent = Agent(chance.choice([0.083, -0.083]), from_s, from_s + chance.uniform(0.2, 3.0))
    nodes = [Node("ocelot"), Node("ocelot"), Node("margay")]
    found = []
    while agent.t < GAP[0]:
        agent.t += 0.1
        agent.pull(chance.choice(nodes), is_new=chance.random() < 0.7)
    for _ in range(3):
        agent.t += GAP[1] - GAP[0]
        agent.frames.begin_first()
        for _ in range(MOST_FIRST):
            agent.t += 0.1
            reached = [node for node in nodes if chance.random() < 0.7]
            found += [older_s for _, older_s in agent.first_states(reached)]
            for node in reached:
                agent.pull(node, is_answer_lost=chance.random() < 0.5, is_new=chance.random() < 0.5)
    assert found, "where no clock is slewed between"
    assert min(found) >= -READ_S


async def test_what_was_not_pulled_in_the_last_seconds_before_the_gap_is_left_to_a_pull() -> None:
    agent = Agent(0.0, 0.0, 1.0)
    ocelot, margay = Node("ocelot"), Node("margay")
    for node in (ocelot, margay):
        agent.pull(node)
        agent.pull(node)
    agent.t = 3.9
    agent.pull(ocelot)
    assert agent.frames.begin_first() == ["ocelot", "margay"]
    agent.t = 4.1
    agent.pull(ocelot)
    assert agent.frames.begin_first() == ["ocelot"]
