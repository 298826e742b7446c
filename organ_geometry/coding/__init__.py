"""The organ file: an organ in few bytes."""
