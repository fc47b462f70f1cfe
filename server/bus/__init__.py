"""State and events between sessions and pages; the journal of events."""
