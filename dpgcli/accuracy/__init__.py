"""Solved states measured against references that share no code with the solver."""
