"""Extended-precision equilibria: a reference that shares no code with the solver."""
