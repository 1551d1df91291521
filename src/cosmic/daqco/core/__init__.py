"""Acquisition, buffering, storage."""
