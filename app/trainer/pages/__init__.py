"""Stand-alone pages and the files that the Export box gives."""
