"""Slowing the car: the one gate through which anything is published to it."""
