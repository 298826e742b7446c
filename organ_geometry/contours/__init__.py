"""The organ's edge in each image, followed from slice to slice."""
