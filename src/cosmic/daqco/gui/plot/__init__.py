"""The picture of `UDaqPlotter`: history, columns, strip, axes, cursors."""
