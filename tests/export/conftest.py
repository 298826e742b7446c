"""What is here but is run by Blender's own Python."""

collect_ignore = ["blender_reader.py"]
