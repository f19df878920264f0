"""How a program guards its work from the workers that it starts: each of them imports it."""

import sys

OF_POOL = "DPG_POOL"  # in the environment of workers of ours
GUARD = 'put what starts its work under if __name__ == "__main__"'


def said_of_guards() -> str:
    """What keeps the workers of a program of somebody else from starting, mostly."""
    is_ours = "dpgcli.__main__" in sys.modules
    return "" if is_ours else f"; each imports the program that starts it: {GUARD}"
