"""Procedures that were recorded by hand, and are edited, kept and replayed."""
