"""Contracts that drivers keep, as suites for pytest: for packages that bring one, and for ours."""
