"""What can go wrong on a link, as exceptions."""

from __future__ import annotations


class LinkDown(ConnectionError):
    """Nothing was sent: there is no connection to the car. Nothing is kept to be sent later."""


class CallFailed(RuntimeError):
    """The bridge answered a service call with a failure, or not in time."""


class Refusal(CallFailed):
    """The bridge answered a service call with a failure: in its own words, which only a rosbridge sends."""


class NoWebSocket(ConnectionError):
    """The connection was taken, and the handshake failed; `answer` is how the other side's words began."""

    def __init__(self, reason: str, answer: bytes) -> None:
        super().__init__(reason)
        self.answer = answer
