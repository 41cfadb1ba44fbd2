#!/usr/bin/env python3
"""Writes the Blender extension's zip into the folder given (by default here), and has Blender check it where there is one.

    blender/build.py [FOLDER]
"""

import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

SOURCE = Path(__file__).resolve().parent / "mixray"
# Extensions came with this version.
OLDEST = (4, 2)


def build(folder):
    """The zip, the same to the byte for the same sources."""
    manifest = tomllib.loads((SOURCE / "blender_manifest.toml").read_text())
    path = Path(folder) / f"{manifest['id']}-{manifest['version']}.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in sorted([*SOURCE.glob("*.py"), SOURCE / "blender_manifest.toml"]):
            archive.writestr(zipfile.ZipInfo(file.name), file.read_bytes(), zipfile.ZIP_DEFLATED)
    return path


def validator():
    """Blender's own command, or the same of the module `bpy`; None without one of either that knows extensions."""
    if _blender_version() >= OLDEST:
        return ["blender", "--command", "extension", "validate"]
    try:
        import bpy
    except ImportError:
        return None
    script = Path(bpy.utils.system_resource("SCRIPTS")) / "addons_core" / "bl_pkg" / "cli" / "blender_ext.py"
    return [sys.executable, str(script), "validate"]


def _blender_version():
    """(major, minor) of the `blender` on the path, (0, 0) without one."""
    if not shutil.which("blender"):
        return 0, 0
    said = subprocess.run(["blender", "--version"], capture_output=True, text=True).stdout
    found = re.search(r"Blender (\d+)\.(\d+)", said)
    return (int(found[1]), int(found[2])) if found else (0, 0)


def main():
    path = build(sys.argv[1] if len(sys.argv) > 1 else ".")
    print(f"written: {path}")
    command = validator()
    if command is None:
        print("not validated: neither `blender` nor the Python module `bpy` is here, of {}.{} or newer".format(*OLDEST))
        return
    sys.exit(subprocess.run([*command, str(path)]).returncode)


if __name__ == "__main__":
    main()
