"""Curved organs cut again, across their own axis."""
