"""The simulated platform as plain physics; numpy and OpenCV, no Qt."""
