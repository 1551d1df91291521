"""The panels of the windows that join subsystems."""
