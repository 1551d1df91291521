"""Machine vision: what is measured on a picture."""
