"""URDF files as other tools write them: meshes named by package://, which MuJoCo cannot resolve."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from motiondeck_base.errors import FileFormatError

_URI = re.compile(r'package://([^/"\']+)/([^"\']*)')


def with_resolved_packages(path: Path, packages: Mapping[str, Path]) -> str | None:
    """The text of a URDF whose meshes are named by absolute paths; None for a file that names no package.

    A package lies in a folder of its name, given in `packages` or found beside or above the file.

    Raises:
        FileFormatError: if a package is in none of these places, or the file cannot be read as text.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise FileFormatError(f"{path}: it cannot be read as text ({error})") from None
    if "package://" not in text or not re.search(r"<robot\b", text):
        return None

    def resolved(uri: re.Match[str]) -> str:
        name, inside = uri[1], uri[2]
        folders = [packages[name]] if name in packages else []
        for above in path.resolve().parents if not folders else ():
            folders += [above] if above.name == name else [above / name]
        found = next((folder / inside for folder in folders if (folder / inside).exists()), None)
        if found is None:
            where = f"in {packages[name]}" if name in packages else f"beside or above {path.resolve().parent}"
            raise FileFormatError(
                f"{path}: {uri[0]} is not {where}. Say where the package is with --package {name}=FOLDER."
            )
        return found.resolve().as_posix()

    text = _URI.sub(resolved, text)
    # MuJoCo takes the folders off the meshes of a URDF, unless the file says otherwise.
    text = re.sub(r"""strippath\s*=\s*["'][^"']*["']""", "", text)
    if "<compiler" in text:
        return text.replace("<compiler", '<compiler strippath="false"', 1)
    return re.sub(r"(<robot\b[^>]*>)", r'\1<mujoco><compiler strippath="false"/></mujoco>', text, count=1)
