"""How near the theories come to the thesis's tables, and where beams stop being right."""
