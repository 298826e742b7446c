"""The panel beside the picture: one module a tab, and what they are made of."""
