"""Finds a way round what is in the way: the enhanced manual control mode (thesis 3.4.2)."""
