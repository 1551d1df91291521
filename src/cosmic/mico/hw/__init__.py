"""Vendor libraries and their simulated counterparts; no Qt."""
