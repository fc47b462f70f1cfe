"""Recordings of every kind, read."""
