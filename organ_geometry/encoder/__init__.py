"""From section contours to the organ file of fewest bytes (docs/encoder.md)."""
