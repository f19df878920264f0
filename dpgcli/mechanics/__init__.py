"""What the energy is: spring laws, the finger, and its two formulations. NumPy only."""
