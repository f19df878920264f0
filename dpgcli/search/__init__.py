"""Inverse design: fingers whose states are as a goal asks for, by descents from many starts."""
