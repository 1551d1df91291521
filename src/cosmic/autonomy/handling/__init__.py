"""Unit operations that handle single fibres."""
