"""From pressure to states: what happens to a finger as pressures change."""
