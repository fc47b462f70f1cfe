"""What is kept at the agents of the cars, and served by web nodes: recordings, exports, mail and replays."""
