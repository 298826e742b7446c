"""Skins, tears, and the files that other programs read."""
