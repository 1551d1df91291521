"""Widgets that every subsystem shares."""
