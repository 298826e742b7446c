"""Class mode in the trainer: the lesson, what trainees see of it, and the teacher's page."""
