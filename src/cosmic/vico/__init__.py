"""ViCo: control of the vision system (thesis 3.2.2). Not built yet."""
