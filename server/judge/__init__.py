"""From a message to a judgement: the same for live drives, replays and checks."""
