"""Runs: their inputs as they are logged, and their files, the older ones too."""
