"""The active settings of the recorder, and all settings in the form that is recorded."""

from __future__ import annotations

from typing import Any

from monitor.check import Limits
from server.judge.active_settings import ActiveSettings
from server.recording.space import Allowance

GB = 1e9


class RecordingSettings:
    """Read each time, because settings change during a recording."""

    def __init__(self, tuning: ActiveSettings) -> None:
        self._tuning = tuning

    def value(self, name: str) -> float:
        """One setting of recording, in SI."""
        limits: Limits = self._tuning.limits.recording
        return float(getattr(limits, name))

    def allowance(self) -> Allowance:
        """What recordings may take of the disk."""
        return Allowance(quota=round(self.value("quota_gb") * GB), min_free=round(self.value("min_free_gb") * GB))

    def as_entry(self) -> dict[str, Any]:
        """All settings in force, for the channel of settings."""
        return {
            "version": self._tuning.settings.version,
            "profile": self._tuning.profile.name,
            "toml": self._tuning.as_toml(),
            "in_force": self._tuning.in_force(),
        }
