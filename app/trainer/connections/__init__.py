"""Who may connect to the trainer, and what a connection may send."""
