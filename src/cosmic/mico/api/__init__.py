"""What other code and scripts call."""
