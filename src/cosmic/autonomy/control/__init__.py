"""Control loops between a measurement and an actuator (F6, thesis 3.2.4)."""
