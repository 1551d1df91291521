"""Teleoperation: an input device steers positioners (M9)."""
