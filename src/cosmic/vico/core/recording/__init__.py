"""Recordings of pictures, snaps and time-lapse (thesis 5.2)."""
