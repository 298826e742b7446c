"""The state that hands act on, in a plane or in space, and what is seen and safe in it."""
