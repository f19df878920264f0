"""Hard cases, each decided by the extended-precision reference."""
