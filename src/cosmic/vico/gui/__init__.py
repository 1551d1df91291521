"""Widgets of ViCo."""
