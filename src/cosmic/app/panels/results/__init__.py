"""The panel Results: sessions, and the viewer of what was recorded."""
