"""What ships with the trainer: the bile-duct phantom's section images and the material presets."""
