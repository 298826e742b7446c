"""The browser trainer: it draws sessions and passes the user's inputs to them."""
