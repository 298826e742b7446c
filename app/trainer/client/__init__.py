"""What one client's page asks for: its state, its replay, its haptic device."""
