"""The image of `UDaqPlotter`: history, columns, strip, axes, cursors."""
