"""From an energy to certified minima; knows no finger."""
