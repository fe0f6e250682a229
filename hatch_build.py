"""Compiles the safety envelope when Motiondeck is built or installed; without a C compiler Python does its work.

The README loses what a package index cannot follow, or a checkout alone has. A wheel with the compiled part is for one
platform, one without it for all.
"""

import re
import shutil
import subprocess
import sysconfig
import tempfile
import zlib
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from hatchling.metadata.plugin.interface import MetadataHookInterface

SOURCE = Path("controller/loop/safety/envelope.c")
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-shared", "-fPIC")


def compile_envelope(source: Path, to: Path) -> bool:
    """Compiles the source into a library; False if there is no compiler, or it fails."""
    compiler = shutil.which("cc")
    if compiler is None:
        return False
    made_from = f"-DENVELOPE_SOURCE={zlib.crc32(source.read_bytes())}u"
    # Under another name first: a run may have the old one open.
    new = to.with_name(f"{to.name}.new")
    done = subprocess.run([compiler, *FLAGS, made_from, "-o", new, source, "-lm"], capture_output=True, check=False)
    if done.returncode == 0:
        new.replace(to)
    return done.returncode == 0


class CompileEnvelope(BuildHookInterface):
    """The build hook of wheels, editable ones too."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Adds the compiled part to a wheel, or puts it beside its source for an editable one."""
        source, inside = Path(self.root) / SOURCE, str(SOURCE.with_suffix(".so"))
        if version == "editable":
            compile_envelope(source, source.with_suffix(".so"))
            return
        self._folder = tempfile.TemporaryDirectory()
        library = Path(self._folder.name) / "envelope.so"
        if compile_envelope(source, library):
            build_data["force_include"][str(library)] = inside
            platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
            build_data["pure_python"], build_data["tag"] = False, f"py3-none-{platform}"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Removes what was compiled for a wheel."""
        if version != "editable":
            self._folder.cleanup()


class ReadmeOfAnIndex(MetadataHookInterface):
    """The README as a package index can show it: without links to files, pictures, or a checkout's commands."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Sets the readme of the metadata."""
        text = (Path(self.root) / "README.md").read_text(encoding="utf-8")
        text = re.sub(r"^!\[[^\]]*\]\((?!https?:)[^)]*\)\n+", "", text, flags=re.M)
        text = re.sub(r"\[([^\]]*)\]\((?!https?:|#)[^)]*\)", r"\1", text)
        text = re.sub(r"^\*\*Run its tests.*?^<!-- -->\n+", "", text, flags=re.M | re.S)
        text = text.replace("pip install -q . ", "pip install -q motiondeck ")
        text += "\nThe files named here are in the source distribution.\n"
        metadata["readme"] = {"content-type": "text/markdown", "text": text}
