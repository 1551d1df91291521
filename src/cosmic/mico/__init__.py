"""MiCo: control of the micromanipulation system (thesis 5.4, 6.1)."""
