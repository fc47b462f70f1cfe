"""Refusals of the catalog."""


class NotThere(Exception):
    """No such recording. The text is one sentence."""


class Refused(Exception):
    """It cannot be done now. The text is one sentence."""
