"""Advice on missing packages is a command that works from any directory, however vsnbench was installed."""

import json
import os
import subprocess
import sys
import tomllib
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.metadata import distribution
from pathlib import Path
from shutil import copytree
from threading import Thread

import pytest

from vsnbench.installation import command_to_add, command_to_install

ROOT = Path(__file__).resolve().parents[1]
ADVICE = "from vsnbench.installation import command_to_add; print(command_to_add('video'))"


def environment_of(directory: Path, *options: str) -> Path:
    """Make an environment that has this one's packages; return its site-packages."""
    subprocess.run([sys.executable, "-m", "venv", *options, str(directory)], check=True)
    (packages,) = directory.glob("lib/python3.*/site-packages")
    (own,) = (Path(folder) for folder in sys.path if folder.endswith("site-packages") and sys.prefix in folder)
    (packages / "shared.pth").write_text(f"{ROOT}\n{own}\n")
    return packages


def install(packages: Path, direct_url: object) -> None:
    """Leave what pip leaves when it installs vsnbench from somewhere."""
    (recorded,) = (file for file in distribution("vsnbench").files or () if file.name == "METADATA")
    metadata = Path(str(recorded.locate())).read_text(encoding="utf-8")
    folder = packages / "vsnbench-1.0.0.dist-info"
    folder.mkdir()
    (folder / "METADATA").write_text(metadata, encoding="utf-8")
    (folder / "direct_url.json").write_text(json.dumps(direct_url))


def wheel(directory: Path) -> Path:
    """Write a wheel that has vsnbench's metadata only."""
    file = directory / "the wheel" / "vsnbench-1.0.0-py3-none-any.whl"
    file.parent.mkdir()
    (recorded,) = (file for file in distribution("vsnbench").files or () if file.name == "METADATA")
    with zipfile.ZipFile(file, "w") as archive:
        info = "vsnbench-1.0.0.dist-info"
        archive.writestr(f"{info}/METADATA", Path(str(recorded.locate())).read_bytes())
        archive.writestr(f"{info}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
        archive.writestr(f"{info}/RECORD", f"{info}/METADATA,,\n{info}/WHEEL,,\n{info}/RECORD,,\n")
    return file


def advised(packages: Path, path: str = os.environ["PATH"]) -> str:
    python = packages.parents[2] / "bin" / "python"
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"} | {"PATH": path}
    done = subprocess.run([python, "-c", ADVICE], capture_output=True, text=True, env=environment, cwd="/")
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_the_advice_of_a_wheel_installs_the_extra_from_another_directory(tmp_path: Path) -> None:
    packages = environment_of(tmp_path / "an environment")
    file = wheel(tmp_path)
    install(packages, {"archive_info": {}, "url": file.as_uri()})
    command = advised(packages)
    assert command == f"'{tmp_path}/an environment/bin/python' -m pip install '{file}[video]'"
    done = subprocess.run(["/bin/sh", "-c", f"{command} --dry-run --no-index"], cwd="/", capture_output=True, text=True)
    assert (done.returncode, "does not provide" in done.stderr) == (0, False), done
    file.unlink()
    assert advised(packages).endswith("pip install 'vsnbench[video]'"), "the wheel is gone"


def test_the_advice_names_pipx_and_uv_where_they_made_the_environment(tmp_path: Path) -> None:
    packages = environment_of(tmp_path / "vsnbench", "--without-pip")
    install(packages, {"dir_info": {"editable": True}, "url": ROOT.as_uri()})
    (packages / "shared.pth").write_text(f"{ROOT}\n")
    (tmp_path / "bin").mkdir()
    uv = tmp_path / "bin" / "uv"
    uv.write_text("#!/bin/sh\n")
    uv.chmod(0o755)
    python = tmp_path / "vsnbench" / "bin" / "python"
    assert advised(packages, str(uv.parent)) == f"uv pip install --python {python} --editable '{ROOT}[video]'"
    (tmp_path / "vsnbench" / "pipx_metadata.json").write_text("{}")
    assert advised(packages) == f"pipx runpip vsnbench install --editable '{ROOT}[video]'"


def test_the_advice_of_a_checkout_that_is_not_installed_names_the_checkout(tmp_path: Path) -> None:
    packages = environment_of(tmp_path / "venv", "--without-pip")
    (packages / "shared.pth").write_text(f"{ROOT}\n")
    assert f"--editable '{ROOT}[video]'" in advised(packages, "/nowhere")


def test_other_packages_are_installed_by_this_interpreter() -> None:
    assert command_to_install("ray[client]==2.52").endswith(" install 'ray[client]==2.52'")
    assert sys.executable in command_to_install("av", "--force-reinstall")


def test_no_advice_has_a_fixed_command_for_an_extra() -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    fixed = [
        f"{file.relative_to(ROOT)}: {extra}"
        for file in (ROOT / "vsnbench").rglob("*.py")
        for extra in extras
        if f"vsnbench[{extra}]" in file.read_text(encoding="utf-8")
    ]
    assert fixed == []
    assert all(f"[{extra}]" in command_to_add(extra) for extra in extras)


class _Index(BaseHTTPRequestHandler):
    """A package index that has an empty wheel of everything, and remembers the names."""

    def do_GET(self) -> None:
        name = self.path.strip("/").split("/")[-1]
        if not name.endswith(".whl"):
            self.server.asked.append(name)  # type: ignore[attr-defined]
            body = f'<a href="/files/{name.replace("-", "_")}-99-py3-none-any.whl">x</a>'.encode()
        else:
            body = empty_wheel(name.partition("-")[0])
        self.send_response(200)
        self.send_header("Content-Type", "text/html" if body.startswith(b"<") else "application/zip")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - the base class's name
        pass


def empty_wheel(name: str) -> bytes:
    from io import BytesIO

    content, info = BytesIO(), f"{name}-99.dist-info"
    with zipfile.ZipFile(content, "w") as archive:
        archive.writestr(f"{info}/METADATA", f"Metadata-Version: 2.1\nName: {name}\nVersion: 99\n")
        archive.writestr(f"{info}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
        archive.writestr(f"{info}/RECORD", "")
    return content.getvalue()


@contextmanager
def package_index() -> Iterator[tuple[str, list[str]]]:
    with ThreadingHTTPServer(("127.0.0.1", 0), _Index) as server:
        server.asked = []  # type: ignore[attr-defined]
        Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/simple", server.asked  # type: ignore[attr-defined]
        server.shutdown()


@pytest.mark.parametrize(
    ("target", "needed"),
    [("dist", {"build", "twine", "check-wheel-contents"}), ("docs-site", {"mkdocs-material"})],
)
def test_a_target_installs_its_own_tools_only(tmp_path: Path, target: str, needed: set[str]) -> None:
    copytree(ROOT / "scripts", tmp_path / "scripts")
    for name in ("Makefile", "pyproject.toml"):
        (tmp_path / name).write_bytes((ROOT / name).read_bytes())
    (tmp_path / "scripts" / "install_system.sh").write_text("#!/bin/sh\necho $@ > system-packages\nexit 1\n")
    with package_index() as (address, asked):
        environment = {name: value for name, value in os.environ.items() if not name.startswith("PIP_")}
        environment |= {
            "PIP_CONFIG_FILE": os.devnull,
            "PIP_INDEX_URL": address,
            "PIP_NO_CACHE_DIR": "1",
            "PYTHON": sys.executable,
        }
        done = subprocess.run(["make", target], cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert set(asked) == needed, done
    assert not (tmp_path / "system-packages").exists()
