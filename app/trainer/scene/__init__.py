"""What a scene draws around the duct's tissue, and what of it can be dragged."""
