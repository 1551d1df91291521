"""What MiCo does: devices, gate, positions; QtCore at most."""
