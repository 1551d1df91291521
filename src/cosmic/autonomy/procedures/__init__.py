"""Procedures: unit operations put together, run, paused and aborted."""
