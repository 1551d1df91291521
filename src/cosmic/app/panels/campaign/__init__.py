"""The panel "Campaign": its board, its table, one fibre, and what is written of it."""
