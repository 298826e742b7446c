"""The server: it serves pages, steps their sessions and prepares what is compiled."""
