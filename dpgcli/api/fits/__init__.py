"""Calibrations from curves, tables and known states, as functions."""
