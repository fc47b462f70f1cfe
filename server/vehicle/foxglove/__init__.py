"""A car's messages from a server of Foxglove's WebSocket protocol: foxglove_bridge, or one made with foxglove-sdk."""
