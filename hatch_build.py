"""The wheel's build: machine code for one level of processors goes into it, so that nobody's first run compiles."""

import os
import platform
import shutil
import subprocess
import sys
import tempfile

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

PLACE = "o3dleaf/core/compiled/machine_code"


class MachineCode(BuildHookInterface):
    """Compiles what the main jobs call into a folder of the wheel, which is then one for a platform and a Python."""

    def initialize(self, version, build_data):
        """Compile, unless the package is only linked to."""
        if version == "editable":
            return
        self.folder = tempfile.mkdtemp()
        environment = os.environ | {"PYTHONPATH": self.root}
        command = [sys.executable, "-m", "o3dleaf.core.compiled.warm_up", self.folder]
        subprocess.run(command, cwd=self.root, env=environment, check=True)
        build_data["force_include"][self.folder] = PLACE
        build_data["pure_python"] = False
        build_data["tag"] = tag()

    def finalize(self, version, build_data, artifact_path):
        """Remove the folder."""
        if version != "editable":
            shutil.rmtree(self.folder)


def tag():
    """Return the wheel's tag: no library is linked, so that on Linux it asks for no more than Numba's own wheels do."""
    python = f"cp{sys.version_info.major}{sys.version_info.minor}"
    machine = platform.machine().lower()
    system = {
        "linux": f"manylinux_2_28_{machine}",
        "darwin": f"macosx_12_0_{machine}",
        "win32": f"win_{machine}",
    }[sys.platform]
    return f"{python}-{python}-{system}"
