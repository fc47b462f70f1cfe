"""HTTPS where there is no internet: an authority of our own, its certificate, and how a phone comes to trust it."""
