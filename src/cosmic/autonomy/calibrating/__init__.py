"""Calibrations that need several applications, as operations, and where they are kept."""
