"""The application: configuration, wiring, and the process that serves it."""
