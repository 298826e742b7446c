"""Hands that are led by scripts: experts, performances, and what they show to be possible."""
