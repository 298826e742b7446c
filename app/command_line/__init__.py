"""The command line, `bluntdissect`."""
