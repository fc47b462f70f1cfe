"""Copies of recordings in an S3-compatible store: sent by the agent that has them, listed and fetched by any server."""
