"""The windows, and what joins them to a platform."""
