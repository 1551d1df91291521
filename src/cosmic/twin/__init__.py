"""The simulated platform as plain physics; numpy only, no Qt."""
