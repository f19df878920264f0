"""Parameter spaces, executors and sweeps; knows no mechanics."""
