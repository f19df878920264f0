"""The program's start, with an answer to Ctrl-C before anything else is imported."""

import gc
import sys

SELDOM = 10**5  # objects made: what imports make stays, and to look through it takes time


def main() -> None:
    """Run the program."""
    gc.set_threshold(SELDOM)
    try:
        from dpgcli.cli.main import main as run

        run()
    except KeyboardInterrupt:  # while the imports are under way; later ones are met by commands
        print("dpg: interrupted; nothing half-written is left", file=sys.stderr)
        sys.exit(130)


if __name__ == "__main__":
    main()
