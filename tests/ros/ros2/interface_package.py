"""Builds a ROS 2 package of interfaces from its definitions, with the generators in pip's wheels and a C compiler.

The wheels have neither nav2_msgs nor tf2_msgs. The packages have the type support of Fast DDS alone.
"""

import json
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import pytest

from tests.shared_records import made_once

SHARE, INCLUDE, LIBRARIES = (Path(sys.prefix) / name for name in ("share", "include", "lib"))
_DEFINITIONS, _TYPE_SUPPORT = Path(__file__).parent / "interfaces", "rosidl_typesupport_fastrtps_c"


def has_package(name: str) -> bool:
    """Return whether this Python has a package: a sourced distribution may have it."""
    return find_spec(name) is not None


def can_have(name: str) -> bool:
    """Return whether a package is there or can be built."""
    return has_package(name) or (shutil.which("gcc") is not None and SHARE.joinpath("rosidl_generator_c").is_dir())


def package_of(name: str, factory: pytest.TempPathFactory) -> Path | None:
    """Return where a package was built for this run of the tests; None where this Python has it."""
    return None if has_package(name) else made_once(factory, name, lambda path: build_interfaces(name, path))


def build_interfaces(name: str, directory: Path) -> None:
    """Build the package with `action/NAME.action` and `msg/NAME.msg` of its definitions, for PYTHONPATH=`directory`."""
    from rosidl_adapter import convert_to_idl
    from rosidl_generator_c import generate_c
    from rosidl_generator_py import generate_py
    from rosidl_generator_type_description import generate_type_hash
    from rosidl_typesupport_c import generate_c as generate_support
    from rosidl_typesupport_fastrtps_c import generate_typesupport_fastrtps_c

    definitions, package = _DEFINITIONS / name, directory / name
    sources = [file.relative_to(definitions) for kind in ("action", "msg") for file in definitions.glob(f"{kind}/*")]
    for source in sources:
        (package / source).parent.mkdir(parents=True, exist_ok=True)
        convert_to_idl(definitions, package.name, source, package)
    interfaces = [source.with_suffix(".idl") for source in sources]

    def generate(with_package: str, generator: Callable[..., object], *words: object) -> None:
        templates = SHARE / with_package / "resource"
        arguments = package / f"{with_package}.json"
        arguments.write_text(
            json.dumps(
                {
                    "package_name": package.name,
                    "output_dir": str(package),
                    "template_dir": str(templates),
                    "target_dependencies": [],
                    "idl_tuples": [f"{package}:{interface}" for interface in interfaces],
                    "include_paths": [f"{path.name}:{path}" for path in SHARE.iterdir()],
                    "type_description_tuples": []
                    if generator is generate_type_hash
                    else [f"{interface}:{package / interface.with_suffix('.json')}" for interface in interfaces],
                }
            )
        )
        generator(str(arguments), *words)
        for header in templates.glob("*visibility_control.h.in"):
            text = header.read_text().replace("@PROJECT_NAME@", package.name)
            written = package / "msg" / header.stem
            written.parent.mkdir(exist_ok=True)
            written.write_text(text.replace("@PROJECT_NAME_UPPER@", package.name.upper()))

    generate("rosidl_generator_type_description", generate_type_hash)
    generate("rosidl_generator_c", generate_c)
    generate(_TYPE_SUPPORT, generate_typesupport_fastrtps_c)
    generate("rosidl_typesupport_c", generate_support, [_TYPE_SUPPORT])
    generate("rosidl_generator_py", generate_py, ["rosidl_typesupport_c"])
    (package / "__init__.py").touch()
    _compile(package)


def _compile(package: Path) -> None:
    """Compile the generated sources to the extension that the package's modules import."""
    import numpy as np

    folders = [package.parent, sysconfig.get_path("include"), np.get_include(), INCLUDE, *INCLUDE.iterdir()]
    needed = sorted(
        library.name.removeprefix("lib").removesuffix(".so")
        for pattern in ("lib*__rosidl_*_c.so", "lib*__rosidl_generator_py.so", "librosidl_*_c*.so", "libfastcdr.so")
        for library in LIBRARIES.glob(pattern)
    )
    extension = f"{package.name}_s__rosidl_typesupport_c{sysconfig.get_config_var('EXT_SUFFIX')}"
    subprocess.run(
        [
            *("gcc", "-shared", "-fPIC", "-O0", "-w", "-o", str(package / extension)),
            *(f"-I{folder}" for folder in folders),
            *(str(source) for ending in ("c", "cpp") for source in sorted(package.rglob(f"*.{ending}"))),
            *(f"-L{LIBRARIES}", "-Wl,--as-needed", *(f"-l{library}" for library in needed), "-lstdc++"),
        ],
        check=True,
    )
