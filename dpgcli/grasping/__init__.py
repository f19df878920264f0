"""Fingers that touch what they hold."""
