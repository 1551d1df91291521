"""Widgets of data acquisition."""
