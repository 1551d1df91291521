"""Procedures that ship with CoSMic."""
