"""Trajectories: movements as readable text, checked and rehearsed before they are made."""
