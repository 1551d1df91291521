"""Acquisition boards behind one Protocol."""
