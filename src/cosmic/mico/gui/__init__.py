"""Widgets of MiCo (thesis appendix E)."""
