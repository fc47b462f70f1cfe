"""Whether a topic is subscribed to as CBOR: not where the bridge has none, nor where it did not arrive. Pure."""

from __future__ import annotations

CBOR_TRIES = 5  # unreadable binary frames before scans are requested as JSON


class CborUse:
    """Of one car's bridge."""

    def __init__(self) -> None:
        self._failed = False  # then everything comes as JSON
        self._noise = 0
        self._json_only: set[str] = set()  # topics that did not arrive as CBOR

    def compression(self, topic: str, is_fit: bool) -> str:
        """CBOR where the type is fit for it: it is smaller, and keeps NaN and the infinities apart."""
        return "cbor" if is_fit and topic not in self._json_only and not self._failed else "none"

    def did_not_arrive(self, topic: str) -> None:
        """It comes as JSON from now on."""
        self._json_only.add(topic)

    def bridge_complains(self, text: str) -> bool:
        """Whether an error of the bridge means that it has no CBOR, as an old one."""
        if "cbor" in text.lower() and "compression" in text.lower() and not self._failed:
            self._failed = True
            return True
        return False

    def binary_noise(self) -> bool:
        """A binary frame that could not be read, where no scan ever could; whether CBOR is given up now."""
        if self._failed:
            return False
        self._noise += 1
        self._failed = self._noise >= CBOR_TRIES
        return self._failed
