"""What others see of a vehicle's recording: its state, why it is so, and how much room is left."""

from __future__ import annotations

from monitor.shell_facts import RecorderFacts, RecorderState
from server.protocol import serialize
from server.protocol.recording_state import RecordingState
from server.recording import space
from server.recording.folder import id_of, part_id
from server.recording.parts import RecordingParts
from server.recording.recorded_topics import Missing
from server.recording.recorder_thread import Status
from server.recording.recording_session import GB, ControllerState, RecordingSettings

NOWHERE = "This server stores nothing: it was started without a data folder."


class RecordingStatus:
    """Reads what the controller and its parts know, and changes nothing."""

    def __init__(
        self, state: ControllerState, parts: RecordingParts, settings: RecordingSettings, *, has_folder: bool
    ) -> None:
        self._controller = state
        self._parts = parts
        self._settings = settings
        self._has_folder = has_folder

    def state(self) -> RecorderState:
        session = self._controller.session
        if session is None:
            return "saving" if self._controller.completing else "off"
        if session.lost_s is not None:
            return "saving" if self._controller.completing else "held"
        if session.is_open and self._parts.status.state == "stopped" and self._parts.is_current(session):
            return "stopped"
        return "recording"

    def why_stopped(self) -> str | None:
        """Why it stopped by itself, as a sentence; None: it did not."""
        return self._parts.status.trouble if self.state() == "stopped" else None

    def facts(self, now_s: float) -> RecorderFacts:
        """For the checks."""
        recorder = self._parts.recorder
        room, limit = self._room(self._parts.status)
        return RecorderFacts(
            state=self.state(),
            trouble=self.why_stopped(),
            dropped=recorder.dropped if recorder is not None else 0,
            dropped_s=recorder.dropped_at_s if recorder is not None else None,
            behind_s=recorder.behind_s(now_s) if recorder is not None else 0.0,
            left_gb=room,
            limit=limit,
        )

    def frame(self, now_s: float) -> RecordingState:
        """The `recording` of a state, as docs/protocol.md has it."""
        session, status, recorder = self._controller.session, self._parts.status, self._parts.recorder
        is_mine = session is not None and self._parts.is_current(session)
        path = status.path if is_mine else None
        room, _ = self._room(status)
        saved = self._controller.saved
        return {
            "state": self.state(),
            "for_s": serialize.plain(now_s - session.began_s, 1) if session is not None else None,
            "name": id_of(path) if path else part_id(session.id, session.newest) if session is not None else None,
            "part": session.newest if session is not None else None,
            "bytes": status.size if is_mine else 0,
            "messages": status.messages if is_mine else 0,
            "as_json": status.misfits if is_mine else 0,
            "dropped": recorder.dropped if recorder is not None and session is not None else 0,
            **(self._controller.missing if session is not None else Missing()).as_json(),
            "room_gb": serialize.plain(room, 2),
            "saved": {"name": saved[0], "until_ms": saved[1]} if saved else None,
            "reason": self._reason(),
        }

    def _reason(self) -> str | None:
        """Why it is not recording, as a sentence; None while it is."""
        if not self._has_folder:
            return NOWHERE
        match self.state():
            case "recording":
                return None
            case "stopped":
                return self.why_stopped()
            case "held" if self._controller.saved is None:
                return f"The link is lost. {self._parts.status.trouble or 'Nothing was recorded yet.'}"
            case "held":
                return (
                    "The link is lost; the recording is saved. A link that returns within "
                    f"{self._settings.value('hold_s'):g} s, the recording continues."
                )
            case "saving":
                return "The recording is being saved."
        if self._controller.stopped_by:
            return f"Recording was stopped by {self._controller.stopped_by}."
        if not self._controller.is_monitoring:
            return "No car is connected."
        return "Recording starts manually (a setting)." if self._settings.value("automatic") < 1 else None

    def _room(self, status: Status) -> tuple[float | None, str]:
        """How many GB may still be recorded, and what ends it."""
        found, allowance = status.space, self._settings.allowance()
        if found is None or self._controller.session is None:
            return None, ""
        by_quota = allowance.quota and allowance.quota - found.used < found.free - allowance.min_free
        limit = (
            f"recordings may take {space.amount(allowance.quota)}"
            if by_quota
            else f"{space.amount(allowance.min_free)} must stay free"
        )
        return found.left(allowance) / GB, limit
