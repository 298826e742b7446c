"""From stacks of images to organ files: the work, its report and its figure."""
