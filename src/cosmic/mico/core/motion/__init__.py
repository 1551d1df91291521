"""What moves: the gate, the devices and their channels, groups, jogs."""
