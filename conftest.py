"""What every pytest run needs, plain or with ``--nbval``, from whatever folder it is started."""

import json
import os
import sys
import tempfile
from pathlib import Path

import hypothesis

from thesis_lib.runs.command_line import list_variables

for profile in ("project", "night"):  # the latter is for more examples where a test asks for it
    hypothesis.settings.register_profile(profile, deadline=None)  # others may have the machine
hypothesis.settings.load_profile("project")
os.environ.update(list_variables())  # before NumPy is imported, as every command does


def pytest_configure(config):
    """Sanitise the notebooks' outputs, and execute them by the kernel that runs have.

    An option with a relative path works in one folder only.
    """
    if config.getoption("nbval_sanitize_with", None) is None:
        file = config.rootpath / "tests" / "nbval_sanitize.cfg"
        config.option.nbval_sanitize_with = str(file)
    if not (config.getoption("nbval", False) or config.getoption("nbval_lax", False)):
        return
    from thesis_lib.runs import execute  # nbval gets nothing of the reader's Jupyter

    folder = tempfile.TemporaryDirectory(prefix="thesis-kernel-")
    config.add_cleanup(folder.cleanup)
    home, place = Path(folder.name, "home"), Path(folder.name, "kernels", "python3")
    spec = {
        "argv": [sys.executable, "-m", "ipykernel_launcher", "-f", "{connection_file}"],
        "env": execute.kernel_environment(os.environ, home),
        "display_name": "Python 3",
        "language": "python",
    }
    for made in (home, place):
        made.mkdir(parents=True)
    (place / "kernel.json").write_text(json.dumps(spec), encoding="utf-8")
    os.environ["JUPYTER_PATH"] = folder.name
    for name in ("CONFIG_DIR", "RUNTIME_DIR"):
        empty = Path(folder.name) / name.lower()
        empty.mkdir()
        os.environ[f"JUPYTER_{name}"] = str(empty)
