"""Bending stiffness of a fibre from how it pushes back."""
