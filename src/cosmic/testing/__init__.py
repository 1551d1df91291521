"""Contracts that drivers keep, as suites for pytest, for packages that bring one and for ours.

Beside them what only tests and benchmarks plug in: a gamepad of SDL alone, a board of any rate.
"""
