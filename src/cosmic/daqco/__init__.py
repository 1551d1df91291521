"""DAQCo: control of the data acquisition system (thesis 5.5, 6.2)."""
