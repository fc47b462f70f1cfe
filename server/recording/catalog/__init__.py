"""The list of recordings, with annotations and surveys."""
