"""What was recorded, as Results shows it: sessions, and one time axis for all of a session."""
