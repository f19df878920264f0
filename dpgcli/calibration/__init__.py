"""Fits, validation and the bridge to finite elements."""
