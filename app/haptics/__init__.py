"""A hand on the duct: haptic devices, the servo loop that gives them force, and a simulated one."""
