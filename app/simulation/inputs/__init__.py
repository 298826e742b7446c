"""What drives a session: its clock, its inputs, and the hands and instruments they lead."""
