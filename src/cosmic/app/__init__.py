"""Composition roots: operator window, scripted API, command line."""
