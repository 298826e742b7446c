"""Half-curves, axis and the frames along it."""
