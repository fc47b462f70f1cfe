"""Situations that people reported of their cars, by the numbers of `reports/README.md` among the shared data."""
