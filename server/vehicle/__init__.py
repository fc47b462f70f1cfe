"""One car: its session, subscriptions, settings and event log."""
