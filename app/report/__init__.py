"""What is said and drawn of a compressed organ."""
