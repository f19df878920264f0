"""Stable shapes of multistable soft grippers, predicted by a lumped spring lattice."""

__version__ = "0.1.0"
