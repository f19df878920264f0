"""From dimensions and calibrations to lattices, for many designs at once."""
