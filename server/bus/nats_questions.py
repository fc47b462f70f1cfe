"""What a web node asks of agents, and what it knows of their clocks."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass

from nats.aio.client import Client
from nats.errors import Error as NatsError
from nats.errors import NoRespondersError

from server.bus import nats_wire as wire
from server.bus.bus import NotServed

log = logging.getLogger("catgraph.bus")

ANSWER_S = 2.0  # for a question; a command has its own deadline


@dataclass(frozen=True, slots=True, kw_only=True)
class AgentClock:
    """The agent's clock as it answered: `now_s` of its run, read by us at `heard_s` of our own clock."""

    run: str
    now_s: float
    heard_s: float

    def earliest(self, now_s: float) -> float:
        """What the agent's clock shows now at least: what is on its way makes it later."""
        return self.now_s + now_s - self.heard_s


class Questions:
    """Asks the agents. `now`: a monotonic clock in seconds."""

    def __init__(self, client: Client, *, now: Callable[[], float]) -> None:
        self._client = client
        self._now = now
        self.clocks: dict[str, AgentClock] = {}
        self.refused = 0  # bodies of agents that could not be read

    def refuse(self, subject: str, why: wire.Malformed) -> None:
        """Counts and logs what cannot be read."""
        self.refused += 1
        log.warning("message not read: subject=%s why=%s", subject, why)

    def set_clock(self, vehicle: str, run: str, now_s: float) -> None:
        """An answer that was just received showed `now_s` on the agent's clock."""
        self.clocks[vehicle] = AgentClock(run=run, now_s=now_s, heard_s=self._now())

    async def ask(self, vehicle: str, asked: wire.Ask, *, within_s: float = ANSWER_S) -> wire.Answer:
        """Raises NotServed: no agent, no broker, no answer in time, or refused by the agent."""
        if not self._client.is_connected:  # else it would wait in the client and come late
            raise NotServed("the broker is not connected")
        try:
            message = await self._client.request(wire.subject(vehicle, "ask"), wire.encode(asked), timeout=within_s)
            answer = wire.decode(wire.Answer, message.data)
        except NoRespondersError:
            raise NotServed(f"{vehicle} is not connected to the broker") from None
        except (NatsError, TimeoutError):
            raise NotServed(f"{vehicle} did not answer within {within_s:.1f} s") from None
        except wire.Malformed as why:
            self.refuse(vehicle, why)
            raise NotServed(f"{vehicle} answered what cannot be read") from None
        self.set_clock(vehicle, answer.run, answer.now_s)
        if answer.refused:
            raise NotServed(answer.refused)
        return answer
