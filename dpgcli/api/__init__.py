"""The commands as functions: values, paths or data frames in, values out; nothing is printed."""
