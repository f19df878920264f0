"""What all tests need."""

import signal

# A shell that starts the tests in the background makes them, and what they start, deaf to
# Ctrl-C; a handler of our own is reset to the default in every program that a test starts.
signal.signal(signal.SIGINT, signal.default_int_handler)
