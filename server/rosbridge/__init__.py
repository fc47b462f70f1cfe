"""The client of a rosbridge server."""
