"""Requests of a web node to its agents, and the agents' clocks."""

from __future__ import annotations

import logging
from collections.abc import Callable
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
