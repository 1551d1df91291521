"""The initialisation sequence as data: what is configured, and what it comes to."""
