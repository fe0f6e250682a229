"""python -m benchmarks NAME [ARGUMENTS]: runs one of the benchmarks in these folders; without a name it lists them."""

from __future__ import annotations

import ast
import runpy
import sys
from pathlib import Path

FOLDER = Path(__file__).parent


def find_benchmarks() -> dict[str, Path]:
    """Every file that runs by itself, by its name; the other files are parts of these."""
    files = sorted(FOLDER.glob("*/*.py"))
    return {file.stem: file for file in files if '__name__ == "__main__"' in file.read_text()}


def main() -> int:
    found = find_benchmarks()
    if len(sys.argv) < 2 or sys.argv[1] not in found:
        for room in sorted({file.parent.name for file in found.values()}):
            print(f"{room}:")
            for name, file in found.items():
                if file.parent.name == room:
                    about = ast.get_docstring(ast.parse(file.read_text())) or ""
                    print(f"  {name:<26} {about.splitlines()[0] if about else ''}")
        return 0 if len(sys.argv) < 2 else 2
    del sys.argv[0]
    file = found[sys.argv[0]]
    runpy.run_module(f"benchmarks.{file.parent.name}.{file.stem}", run_name="__main__", alter_sys=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
