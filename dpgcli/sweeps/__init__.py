"""Sweeps: spaces, evaluation of designs, executors, metrics and requirements."""
