# pyright: strict
"""The `motiondeck` command: looks whether other packages shadow ours, then runs the command line."""

import importlib.util
import sys
from collections.abc import Iterator
from pathlib import Path

HOME = Path(__file__).resolve().parents[1]
PACKAGES = ("motiondeck_base", "controller", "sim", "hardware")


def main() -> None:
    """Runs the command line; where a foreign package shadows one of ours, prints one line and exits with code 1."""
    for line in shadowed():
        print(f"motiondeck: {line}", file=sys.stderr)
        sys.exit(1)
    from motiondeck.cli.main import main as run

    run()


def shadowed(beside: Path = HOME) -> Iterator[str]:
    """A line for each of our packages that Python would import from elsewhere than `beside`, and what to do about it.

    Nothing is imported to find out.
    """
    for package in PACKAGES:
        spec = importlib.util.find_spec(package)
        found = [Path(place).resolve() for place in (spec.submodule_search_locations or ()) if place] if spec else []
        if spec is not None and spec.origin is not None and not found:
            found = [Path(spec.origin).resolve()]  # a module instead of a package
        if beside / package in found[:1]:
            continue
        if not found:
            yield f"the package '{package}' is missing. Install motiondeck again."
            continue
        yield (
            f"{found[0]} stands in front of Motiondeck's own package '{package}' in {beside}. Start from another "
            "folder, take that one off PYTHONPATH, or rename it."
        )
