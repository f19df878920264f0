"""Parameter spaces, executors, design metrics and requirements of sweeps."""
