"""Tubes found in a volume of labels: their axes, walls and joins."""
