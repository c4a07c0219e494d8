"""The model server shown in the docs works with `vsnbench run`."""

import re
import subprocess
import sys
from pathlib import Path

from tests.docs.pages import ROOT
from tests.docs.reading import Shell
from tests.models.remote.servers import STUB, await_port, free_port


def test_the_server_of_the_page_drives_a_trial(tmp_path: Path) -> None:
    page = (ROOT / "docs" / "models-elsewhere.md").read_text(encoding="utf-8")
    server = re.findall(r"^```python\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)[0]
    gpu_box, port = tmp_path / "gpu-box", free_port()
    gpu_box.mkdir()
    (gpu_box / STUB.name).write_bytes(STUB.read_bytes())
    (gpu_box / "mymodel.py").write_text(server.replace("8765", str(port)), encoding="utf-8")
    with subprocess.Popen([sys.executable, "mymodel.py"], cwd=gpu_box, stderr=subprocess.DEVNULL) as process:
        try:
            await_port(port)
            shell = Shell(tmp_path, {})
            shell.types(f"vsnbench run --model ws://127.0.0.1:{port} --goal chair --starts 1 --max-steps 6")
        finally:
            process.terminate()
