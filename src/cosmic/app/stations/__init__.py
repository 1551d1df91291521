"""The applications of a process, served to others and used from others."""
