"""The energy: spring laws, the finger, and its two systems of coordinates. NumPy only."""
