"""The duct in the scene, what is drawn around it, and what can be dragged."""
