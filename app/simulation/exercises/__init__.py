"""What is asked and judged: metrics, classes of errors, goals, limits, and exercises."""
