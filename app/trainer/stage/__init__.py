"""What stands still around the duct: tissue bed, clamps, hook, lights and camera."""
