"""Other people's programs against our bridge, recordings, exports, interface and page (docs/peers.md)."""
