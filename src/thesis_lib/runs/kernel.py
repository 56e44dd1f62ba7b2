"""The kernel that notebooks are executed by: this Python, isolated from the reader's machine."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

from jupyter_client.kernelspec import KernelSpec
from jupyter_client.manager import AsyncKernelManager
from jupyter_client.provisioning.local_provisioner import LocalProvisioner
from traitlets import default

from thesis_lib.runs import kernel_main, nursery


def spec() -> KernelSpec:
    """How the kernel is started; no installed kernel is asked for."""
    return KernelSpec(
        argv=[sys.executable, "-I", kernel_main.__file__, "-f", "{connection_file}"],
        name="python3",
        display_name="Python 3",
        language="python",
        metadata={"kernel_provisioner": {"provisioner_name": "local-provisioner"}},
    )


def manager(home: Path) -> type[AsyncKernelManager]:
    """A class of kernel managers whose kernel lives in the folder `home`."""
    home.mkdir()

    class Manager(AsyncKernelManager):
        @property
        def kernel_spec(self) -> KernelSpec:
            return spec()

        @default("connection_file")
        def _in_its_home(self) -> str:
            return str(home / "connection.json")

        async def _async_start_kernel(self, **how: Any) -> None:
            # What is said beside the notebook, such as a warning at the start, is for nobody.
            with Path(os.devnull).open("w") as nowhere:
                await super()._async_start_kernel(**how, stdout=nowhere, stderr=nowhere)

        async def _async_launch_kernel(self, kernel_cmd: list[str], **how: Any) -> None:
            copied: Any = nursery.kernel(kernel_cmd[3:])
            local = self.provisioner
            if copied is None or not isinstance(local, LocalProvisioner):
                await super()._async_launch_kernel(kernel_cmd, **how)
            else:
                local.process, local.pid, local.pgid = copied, copied.pid, copied.pid
                self._reconcile_connection_info(local.connection_info)

        async def _async_shutdown_kernel(self, now: bool = False, restart: bool = False) -> None:
            # All is written by then, and a kernel takes 0.7 s to take its leave.
            await super()._async_shutdown_kernel(now=True, restart=restart)

        _launch_kernel = _async_launch_kernel
        start_kernel = _async_start_kernel
        shutdown_kernel = _async_shutdown_kernel

    return Manager
