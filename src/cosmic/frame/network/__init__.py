"""Stations: applications that are used from another process or computer as if they were here."""
