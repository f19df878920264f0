"""Whole studies, composed of a space, an evaluation, an executor and files."""
