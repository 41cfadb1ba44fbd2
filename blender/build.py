#!/usr/bin/env python3
"""Writes the Blender extension's zip into the folder given (by default here), and has Blender check it where there is one.

    blender/build.py [FOLDER]
"""

import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

SOURCE = Path(__file__).resolve().parent / "mixray"


def build(folder):
    """The zip, the same to the byte for the same sources."""
    manifest = tomllib.loads((SOURCE / "blender_manifest.toml").read_text())
    path = Path(folder) / f"{manifest['id']}-{manifest['version']}.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in sorted([*SOURCE.glob("*.py"), SOURCE / "blender_manifest.toml"]):
            archive.writestr(zipfile.ZipInfo(file.name), file.read_bytes(), zipfile.ZIP_DEFLATED)
    return path


def validator():
    """Blender's own command, or the same of the module `bpy`; None without either."""
    if shutil.which("blender"):
        return ["blender", "--command", "extension", "validate"]
    try:
        import bpy
    except ImportError:
        return None
    script = Path(bpy.utils.system_resource("SCRIPTS")) / "addons_core" / "bl_pkg" / "cli" / "blender_ext.py"
    return [sys.executable, str(script), "validate"]


def main():
    path = build(sys.argv[1] if len(sys.argv) > 1 else ".")
    print(f"written: {path}")
    command = validator()
    if command is None:
        print("not validated: neither `blender` nor the Python module `bpy` is here")
        return
    subprocess.run([*command, str(path)], check=True)


if __name__ == "__main__":
    main()
