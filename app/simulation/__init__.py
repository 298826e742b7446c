"""A dissection without a viewer: presets, the organ as a beam, the session and its tear."""
