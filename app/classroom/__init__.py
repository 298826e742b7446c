"""A class: its people, what its teacher sets, and the results, in one file that outlives kills."""
