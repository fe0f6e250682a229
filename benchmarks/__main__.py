"""python -m benchmarks NAME [ARGUMENTS]: runs one of the benchmarks in this folder; without a name it lists them."""

from __future__ import annotations

import ast
import runpy
import sys
from pathlib import Path

FOLDER = Path(__file__).parent


def main() -> int:
    names = sorted(path.stem for path in FOLDER.glob("*.py") if not path.stem.startswith("_"))
    if len(sys.argv) < 2 or sys.argv[1] not in names:
        for name in names:
            about = ast.get_docstring(ast.parse((FOLDER / f"{name}.py").read_text())) or ""
            print(f"{name:<26} {about.splitlines()[0] if about else ''}")
        return 0 if len(sys.argv) < 2 else 2
    del sys.argv[0]
    runpy.run_module(f"benchmarks.{sys.argv[0]}", run_name="__main__", alter_sys=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
