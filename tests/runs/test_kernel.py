"""Nothing of the reader's machine enters a result, and nothing of it is said on the screen."""

import json
import os

import psutil
import pytest
import xarray as xr

from conftest import until_study
from thesis_lib.figure_sets.registry import validate_request
from thesis_lib.runs.execute import execute_notebook, kernel_environment
from thesis_lib.studies.schema import RUN_DEPENDENT

NAME = "beam-distance"
RUN = ["run", NAME, "-p", "trials=2", "-p", "modes=[1]", "--out"]
FALSIFIES = "import numpy\nnumpy.rint = numpy.floor\n"


def write(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def hostile(folder):
    """A home, a working directory and an environment that interfere wherever one can."""
    home, cwd, evil = folder / "home", folder / "cwd", folder / "evil"
    said = f"open({str(folder / 'ran')!r}, 'a').write(__file__ + '\\n')\n"
    for profile in (home / ".ipython", folder / "ipython"):
        write(profile / "profile_default" / "startup" / "00.py", said + FALSIFIES)
        config = f"c.InteractiveShellApp.exec_lines = [{FALSIFIES!r}]\n"
        write(profile / "profile_default" / "ipython_config.py", said + config)
        write(profile / "profile_default" / "ipython_kernel_config.py", said + config)
    for place in (home / ".jupyter", folder / "jupyter"):
        for name in ("jupyter_config", "jupyter_client_config", "jupyter_nbclient_config"):
            write(place / f"{name}.py", said + "c.KernelManager.transport = 'bogus'\n")
    spec = {"argv": ["/bin/false"], "display_name": "x", "language": "python"}
    for place in (home / ".local/share/jupyter", folder / "data"):
        write(place / "kernels" / "python3" / "kernel.json", json.dumps(spec))
    for module in ("numpy", "thesis_lib/__init__", "matplotlib", "json", "sitecustomize"):
        write(cwd / f"{module}.py", said + "raise ImportError('not this one')\n")
    write(evil / "usercustomize.py", said + FALSIFIES)
    for place in (cwd / "matplotlibrc", home / ".config" / "matplotlib" / "matplotlibrc"):
        write(place, "text.usetex: True\nfont.size: 33\nno.such.key: 1\n")
    write(home / ".ncrc", "HTTP.VERBOSE=1\n")
    write(home / ".config" / "dask" / "dask.yaml", "array: {chunk-size: 1B}\n")
    return {
        "HOME": str(home),
        "IPYTHONDIR": str(folder / "ipython"),
        "JUPYTER_PATH": str(folder / "data"),
        "JUPYTER_CONFIG_DIR": str(folder / "jupyter"),
        "JUPYTER_CONFIG_PATH": str(folder / "jupyter"),
        "JUPYTER_DEFAULT_PROVISIONER_NAME": "no-such-provisioner",
        "PYTHONSTARTUP": str(write(folder / "startup.py", said + FALSIFIES)),
        "PYTHONHASHSEED": "17",
        "PYTHONOPTIMIZE": "2",
        "PYTHONWARNINGS": "always",
        "PYTHONINSPECT": "",
        "MPLBACKEND": "no-such-backend",
        "OMP_NUM_THREADS": "2",
        "OPENBLAS_NUM_THREADS": "2",
        "MPLCONFIGDIR": "/dev/null/nowhere",
        "NUMEXPR_MAX_THREADS": "x",
        "HDF5_DISABLE_VERSION_CHECK": "0",
        "PAGER": "false",
        "LC_ALL": "tr_TR.UTF-8",
        "TZ": "Asia/Kathmandu",
    }


@pytest.mark.nightly
def test_a_hostile_machine_gives_the_same_cube_and_says_nothing(checkout, tmp_path):
    checkout.change(NAME, until_study)
    done = checkout.thesis(*RUN, tmp_path / "plain", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    extra = hostile(tmp_path)
    path = f"{checkout.root / 'src'}{os.pathsep}{tmp_path / 'evil'}"
    script = write(tmp_path / "bin" / "thesis", "from thesis_lib.cli import main\nmain()\n")
    cwd = tmp_path / "cwd"
    done = checkout.python(script, *RUN, tmp_path / "out", cwd=cwd, **extra, PYTHONPATH=path)
    assert done.returncode == 0, done.stderr
    assert all(line.startswith("[") for line in done.stderr.splitlines())  # progress alone
    ran = tmp_path / "ran"
    assert not ran.exists() or set(ran.read_text().split()) <= {
        str(tmp_path / "evil" / "usercustomize.py")  # of the command's own process
    }
    a, b = (xr.load_dataset(tmp_path / folder / f"{NAME}.nc") for folder in ("plain", "out"))
    for name in RUN_DEPENDENT:
        del a.attrs[name], b.attrs[name]
    assert a.identical(b)


@pytest.mark.slow
def test_a_kernel_ends_with_its_notebook(tmp_path):
    """A book executes 26 notebooks in one process; each idle kernel would keep 0.3 GB."""
    before = set(psutil.Process().children(recursive=True))  # of other tests in this process
    execute_notebook(validate_request(NAME, {"trials": 2, "modes": [1]}), tmp_path)
    assert set(psutil.Process().children(recursive=True)) <= before


@pytest.mark.slow
def test_a_plan_takes_no_module_from_elsewhere(checkout, tmp_path):
    """Those that are there cannot be imported."""
    plan = ["-m", "thesis_lib", "plan", "-p", "counts=[2]", "-p", "starts=0", "-p", "trials=5"]
    for module in ("numpy", "scipy", "xarray", "matplotlib"):
        write(tmp_path / "evil" / f"{module}.py", "raise ImportError('not this one')\n")
    path = f"{tmp_path / 'evil'}{os.pathsep}{checkout.root / 'src'}"
    words = ["-p", "target_percent=null", "--out", tmp_path / "plan"]
    done = checkout.python(*plan, *words, cwd=tmp_path / "evil", PYTHONPATH=path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "plan" / "plan.nc").is_file()


def test_of_the_environment_only_what_is_named_is_left(tmp_path):
    emulation = {"OPENBLAS_CORETYPE": "Haswell", "NPY_DISABLE_CPU_FEATURES": "X86_V4",
                 "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2"}  # fmt: skip
    given = {"PATH": "/bin", "OMP_NUM_THREADS": "4", "PYTHONPATH": "x", "HOME": "/root"}
    left = kernel_environment(given | emulation, tmp_path)
    assert left.items() >= emulation.items()
    assert left["HOME"] == str(tmp_path)
    assert left["PATH"] == "/bin"
    assert left.get("PYTHONPATH") != "x"
    assert {value for name, value in left.items() if name.endswith("_NUM_THREADS")} == {"1"}
