"""Error against run time: benchmark methods, third-party minimizers, ablations."""
