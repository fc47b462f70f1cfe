"""Replay in the page: a recording goes through the same decoding and judging as the car, once for each who looks."""
