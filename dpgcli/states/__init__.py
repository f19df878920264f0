"""Activation patterns and the certified stable states behind them."""
