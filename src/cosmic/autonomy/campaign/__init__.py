"""Campaigns: many fibres after one recipe, each with its record."""
