"""``python -m thesis_lib`` is the ``thesis`` command."""

import os
import sys
from pathlib import Path

if __name__ == "__main__":
    try:
        if sys.path[0] == os.getcwd():  # noqa: PTH109
            sys.path[0] = str(Path(__file__).resolve().parents[1])  # not the user's modules
    except FileNotFoundError:  # the working directory has been deleted
        pass
    from thesis_lib.cli import main

    main()
