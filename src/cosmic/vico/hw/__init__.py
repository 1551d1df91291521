"""Cameras, lenses and lights: one file a vendor library or protocol, the simulated ones beside."""
