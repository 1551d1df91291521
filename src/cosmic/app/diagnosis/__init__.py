"""What is on this computer: the checks behind ``cosmic doctor``."""
