"""Doors for programs that are not CoSMic: HTTP, EPICS. All are users of the declaration."""
