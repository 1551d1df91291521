"""Plans a path past what blocks the straight one: the enhanced manual control (thesis 3.4.2)."""
