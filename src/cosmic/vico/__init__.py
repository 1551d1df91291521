"""ViCo: control of the vision system (thesis 5.2)."""
