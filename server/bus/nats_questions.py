"""Requests of a web node to its agents, the agents' clocks, and which agents are silent."""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Any

from nats.aio.client import Client
from nats.errors import Error as NatsError
from nats.errors import NoRespondersError

from server.bus import nats_wire as wire
from server.bus.bus import NotServed, Outcome

log = logging.getLogger("catgraph.bus")

LOG_AGAIN_S = 10.0  # what an agent sends fills no log
ReadEvent = Callable[[dict[str, Any]], dict[str, Any]]
ANSWER_S = 2.0  # for a question; a command has its own deadline
SILENT_AFTER_S = 1.5  # an agent announces itself every second: pages cover their values after 2 s, and state why
GONE_AFTER_S = 3.0  # an agent that was silent for so long gets no requests


@dataclass(frozen=True, slots=True, kw_only=True)
class AgentClock:
    """The agent's clock as it answered: `now_s` of its run, read by us at `received_s` of our own clock."""

    run: str
    now_s: float
    received_s: float

    def earliest(self, now_s: float) -> float:
        """What the agent's clock shows now at least: what is on its way makes it later."""
        return self.now_s + now_s - self.received_s


class Questions:
    """Sends requests to the agents. `now`: a monotonic clock in seconds."""

    def __init__(self, *, now: Callable[[], float], read_event: ReadEvent = lambda event: event) -> None:
        """`read_event`: an event of an agent as pages get it."""
        self.read_event = read_event
        self.client: Client | None = None  # None: there was no connection yet
        self._now = now
        self.clocks: dict[str, AgentClock] = {}
        self.received_s = 0.0  # when any agent answered last
        self._logged_s: dict[str, float] = {}  # of each subject
        self.refused = 0  # bodies of agents that could not be read

    def refuse(self, subject: str, why: wire.Malformed) -> None:
        """Counts and logs what cannot be read."""
        self.refused += 1
        if self._now() - self._logged_s.get(subject, -LOG_AGAIN_S) < LOG_AGAIN_S:
            return
        self._logged_s[subject] = self._now()
        log.warning("message not read: subject=%s why=%s", subject, why)

    def set_clock(self, vehicle: str, run: str, now_s: float) -> None:
        """An answer that was just received showed `now_s` on the agent's clock."""
        self.received_s = self._now()
        self.clocks[vehicle] = AgentClock(run=run, now_s=now_s, received_s=self.received_s)

    async def ask(self, vehicle: str, request: wire.Ask, *, within_s: float = ANSWER_S) -> wire.Answer:
        """Raises NotServed: no agent, no broker, no answer in time, or refused by the agent."""
        client = self.client
        if client is None or not client.is_connected:  # else it would wait in the client and come late
            raise NotServed("the broker is not connected", cut="server-broker")
        data = wire.encode(request)
        if len(data) > wire.largest(client.max_payload):  # the broker would end the connection
            raise NotServed(
                f"the request is too large for the broker ({len(data) // 1000} kB)", outcome="not_delivered"
            )
        try:
            message = await client.request(wire.subject(vehicle, "ask"), data, timeout=within_s, headers=wire.headers())
            answer = wire.decode(wire.Answer, message.data)
        except NoRespondersError:
            raise NotServed(f"the agent of {vehicle} is not connected to the broker", cut="broker-agent") from None
        except (NatsError, TimeoutError):
            raise self._unanswered(vehicle, client, within_s) from None
        except wire.Malformed as why:
            self.refuse(vehicle, why)
            raise NotServed(f"the agent of {vehicle} answered what cannot be read", outcome="unknown") from None
        self.set_clock(vehicle, answer.run, answer.now_s)
        numbered = [one for one in answer.events if type(one.get("n")) is int]
        answer = answer.model_copy(update={"events": [self.read_event(one) for one in numbered]})
        if answer.refused:
            outcome: Outcome = "unknown" if answer.is_unknown else "not_delivered"
            raise NotServed(answer.refused, outcome=outcome)  # the agent answers: no link is cut
        return answer

    def _unanswered(self, vehicle: str, client: Client, within_s: float) -> NotServed:
        """It was sent: it may have been lost on its way there, or its answer on the way back."""
        if not client.is_connected:
            return NotServed("the broker was lost before it answered", outcome="unknown", cut="server-broker")
        why = f"the agent of {vehicle} did not answer within {within_s:.1f} s"
        return NotServed(why, outcome="unknown", cut="broker-agent")

    async def read(
        self, vehicle: str, limit: int, question: Callable[[int | None, int], wire.Ask]
    ) -> list[dict[str, Any]]:
        """Events in portions: `question` gets the number of the last one that was read, and how many to ask for.

        Raises as `ask`.
        """
        found: list[dict[str, Any]] = []
        while len(found) < limit:
            portion = min(limit - len(found), wire.PORTION)
            answer = await self.ask(vehicle, question(found[-1]["n"] if found else None, portion))
            found += answer.events
            if len(answer.events) < portion and not (answer.is_cut and answer.events):
                break
        return found


class AgentLiveness:
    """`now`: a monotonic clock in seconds; `expected`: vehicles that are listed before their agents send anything."""

    def __init__(self, questions: Questions, *, now: Callable[[], float], expected: Collection[str] = ()) -> None:
        self._questions = questions
        self._now = now
        self._expected = frozenset(expected)
        self._received_s: dict[str, float] = {}
        self._newest_s = 0.0  # of any agent
        self._connections: dict[str, tuple[str, int]] = {}  # by which each announced itself last: its run, and number

    @property
    def vehicles(self) -> tuple[str, ...]:
        """All that are expected or whose agents ever sent something; a lost one is listed as lost."""
        return tuple(sorted(self._expected | self._received_s.keys()))

    def note(self, vehicle: str) -> None:
        """Something was received from its agent just now."""
        self._received_s[vehicle] = self._newest_s = self._now()

    def connects(self, vehicle: str, here: wire.Here) -> bool | None:
        """Whether its agent connected again since it announced itself last; None: this was sent before, by an earlier
        connection. Behind a gap the system still delivers it, and it shows nothing of now."""
        run, before = self._connections.get(vehicle, ("", 0))
        if here.run == run and here.connection < before:
            return None
        self._connections[vehicle] = (here.run, here.connection)
        return here.run == run and here.connection > before

    def trouble(self, vehicle: str) -> str | None:
        """As `PageBus.trouble`."""
        client = self._questions.client
        if client is None or not client.is_connected:
            return "The broker between the server and the car does not answer."
        if vehicle not in self._received_s:
            return f"The agent of {vehicle} has sent nothing since the server started."
        if self._is_live(vehicle):
            return None
        if self._now() - max(self._newest_s, self._questions.received_s) <= SILENT_AFTER_S:
            return f"The agent of {vehicle} does not answer."
        return f"Nothing comes from the agent of {vehicle}: it or the broker does not answer."

    def is_gone(self, vehicle: str) -> bool:
        """Whether nothing came from it for so long that what it was requested is lost; False: or it was never there."""
        return vehicle in self._received_s and self._silent_s(vehicle) > GONE_AFTER_S

    def check_known(self, vehicle: str) -> None:
        """Raises NotServed where nothing was ever received from the agent."""
        if vehicle not in self._received_s:
            is_expected = vehicle in self._expected
            raise NotServed(
                f"nothing was received from {vehicle} yet" if is_expected else f"no vehicle is named {vehicle}"
            )

    def check(self, vehicle: str) -> None:
        """Raises NotServed where the agent is not known, or has been silent for too long."""
        self.check_known(vehicle)
        received_s = self._received_s[vehicle]
        if self._now() - received_s > GONE_AFTER_S:
            why = f"nothing came from the agent of {vehicle} for {self._now() - received_s:.0f} s"
            raise NotServed(why, cut="broker-agent")

    def _is_live(self, vehicle: str) -> bool:
        return self._silent_s(vehicle) <= SILENT_AFTER_S

    def _silent_s(self, vehicle: str) -> float:
        """Since anything came from it."""
        clock = self._questions.clocks.get(vehicle)
        return self._now() - max(self._received_s[vehicle], clock.received_s if clock is not None else 0.0)
