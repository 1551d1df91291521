"""What scripts and windows call."""
