"""All states of a long finger as pairs of half-fingers, solved once each."""
