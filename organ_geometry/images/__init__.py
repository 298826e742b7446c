"""Images in: files of many kinds, and the stack of slices they become."""
