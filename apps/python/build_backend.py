"""Builds the Python module as a wheel for `pip install .` (PEP 517): CMake does the work, this packs what it leaves.

It needs CMake, a compiler and the -dev packages of scripts/install_packages.sh, and no Python package but pip itself.
The version is that of CMakeLists.txt. Settings: `pip install . -C cmake=-DROTSLAM_WITH_HEIF=OFF`.
"""

import base64
import hashlib
import os
import re
import shlex
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

_ROOT = Path(__file__).resolve().parents[2]
_SUMMARY = "Known-rotation monocular SLAM: rotations first, positions by quasi-convex optimisation"


def _version():
    text = (_ROOT / "CMakeLists.txt").read_text(encoding="utf-8")
    return re.search(r"project\(rotslam VERSION ([0-9.]+)", text)[1]


def _tag():
    interpreter = f"cp{sys.version_info.major}{sys.version_info.minor}"
    platform = re.sub(r"[-.]", "_", sysconfig.get_platform())
    return f"{interpreter}-{interpreter}-{platform}"


def _metadata():
    return (
        f"Metadata-Version: 2.1\nName: rotslam\nVersion: {_version()}\nSummary: {_SUMMARY}\n"
        "License: BSD-3-Clause\nRequires-Python: >=3.8\nRequires-Dist: numpy\n"
    )


def _build(settings):
    """The folder in which the module and its type stubs lie."""
    folder = _ROOT / "build" / f"pip-{sysconfig.get_config_var('SOABI')}"
    arguments = settings.get("cmake", []) if settings else []
    if isinstance(arguments, str):
        arguments = shlex.split(arguments)
    generator = ["-G", "Ninja"] if shutil.which("ninja") and not (folder / "CMakeCache.txt").exists() else []
    subprocess.run(
        [
            "cmake", "-S", str(_ROOT), "-B", str(folder), *generator,
            "-DCMAKE_BUILD_TYPE=Release", "-DCMAKE_UNITY_BUILD=ON", "-DROTSLAM_BUILD_TESTS=OFF",
            f"-DPython_EXECUTABLE={sys.executable}", *arguments,
        ],
        check=True,
    )  # fmt: skip
    subprocess.run(
        ["cmake", "--build", str(folder), "--target", "rotslam_python", "--parallel", str(os.cpu_count() or 1)],
        check=True,
    )
    return folder / "apps" / "python"


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    built = _build(config_settings)
    contents = {file.name: file.read_bytes() for file in (*built.glob("rotslam.*.so"), built / "rotslam.pyi")}
    if len(contents) != 2:
        raise RuntimeError(f"{built}: expected one module and its stubs, found {', '.join(contents)}")
    information = f"rotslam-{_version()}.dist-info"
    contents[f"{information}/METADATA"] = _metadata().encode()
    contents[f"{information}/LICENSE"] = (_ROOT / "LICENSE").read_bytes()
    contents[f"{information}/WHEEL"] = (
        f"Wheel-Version: 1.0\nGenerator: rotslam\nRoot-Is-Purelib: false\nTag: {_tag()}\n".encode()
    )
    record = ""
    for name, content in contents.items():
        digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
        record += f"{name},sha256={digest},{len(content)}\n"
    contents[f"{information}/RECORD"] = f"{record}{information}/RECORD,,\n".encode()

    wheel = f"rotslam-{_version()}-{_tag()}.whl"
    with zipfile.ZipFile(Path(wheel_directory) / wheel, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in contents.items():
            archive.writestr(name, content)
    return wheel


def build_sdist(sdist_directory, config_settings=None):
    raise NotImplementedError("no source distribution: `git archive` makes a source archive")
