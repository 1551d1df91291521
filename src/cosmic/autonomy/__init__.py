"""What needs more than one subsystem, without widgets."""
