"""A guard on the car: slows it when the operator's heartbeat stops."""

__version__ = "0.1.0"
