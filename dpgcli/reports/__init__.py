"""From tables to figures and summaries; no solver."""
