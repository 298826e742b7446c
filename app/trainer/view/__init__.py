"""A page in one mode: its scene and its panel, told of each tick."""
