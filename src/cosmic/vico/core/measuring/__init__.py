"""Fibres measured on images from anywhere, without a platform."""
