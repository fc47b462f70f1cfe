"""MCAP files, written and read."""
