"""Recordings of images, snaps and time-lapse (thesis 5.2)."""
