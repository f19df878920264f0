"""Springs calibrated from finite elements or tests."""
