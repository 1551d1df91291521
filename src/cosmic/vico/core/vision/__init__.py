"""Machine vision: what is measured on an image."""
