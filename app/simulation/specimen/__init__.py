"""What is in hand, as values: presets, ducts with their surfaces, tubes of an anatomy."""
