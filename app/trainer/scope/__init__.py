"""The triangle of Calot through a laparoscope: its pose, its picture, and what leads it."""
