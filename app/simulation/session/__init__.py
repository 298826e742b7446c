"""One tissue that inputs drive, with the measures and the errors of its run."""
