"""The static things around the duct (tissue bed, clamps, hook, lights, camera), and its surface."""
