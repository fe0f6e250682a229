"""Seconds from the command to the first tick and to a page, and to import.

Each is a new process. `tick` is the first one of `play --headless`, `tick with page` that of `play` with a page, `page`
the first reply of the page to a browser's request, and `import` the whole of `python -c "import motiondeck"` less that
of an empty program. Wall time is from before the process is started; CPU time is that of the process, user and system,
and depends less on what else the machine does. Cold starts have the files of Python's modules thrown out of the
system's cache before each one; warm starts have them there. With --beside another checkout is measured too, in turn.
Modules are compiled once, as an installation does it.
"""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from benchmarks.command import run

HERE = Path(__file__).parents[2]
PATIENCE = 60.0  # s

# Runs the command line, and ends it in its first tick after writing down when that was; no module is imported sooner.
_TO_THE_FIRST_TICK = """
import importlib.abc, importlib.util, os, resource, sys, time
class Hook(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name != "controller.loop.clock":
            return None
        sys.meta_path.remove(self)
        spec = importlib.util.find_spec(name)
        execute = spec.loader.exec_module
        def patched(module):
            execute(module)
            module.Ticker.wait = done
        spec.loader.exec_module = patched
        return spec
def done(clock):
    used = resource.getrusage(resource.RUSAGE_SELF)
    if not os.path.exists(out):
        files = {line.split()[-1] for line in open("/proc/self/maps") if "/" in line.split()[-1]}
        for module in list(sys.modules.values()):
            files |= {getattr(module, "__file__", None), getattr(module, "__cached__", None)} - {None}
        with open(out + ".part", "w") as file:
            print(time.monotonic(), used.ru_utime + used.ru_stime, *sorted(map(str, files)), sep="\\n", file=file)
        os.rename(out + ".part", out)
    if "--headless" in sys.argv:
        os._exit(0)
    time.sleep(0.01)
    return 0
out = sys.argv.pop(1)
sys.meta_path.insert(0, Hook())
from motiondeck.command import main  # there in earlier checkouts, too
main()
"""


COMPILED = tempfile.TemporaryDirectory()


def environment(checkout: Path) -> dict[str, str]:
    """What a process of a checkout finds in its environment."""
    ours = {"PYTHONPATH": str(checkout), "PYTHONPYCACHEPREFIX": COMPILED.name}
    return {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"} | ours


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def answers(port: int) -> bool:
    """Whether a page replies there."""
    try:
        with socket.create_connection(("127.0.0.1", port), 0.2) as connection:
            connection.settimeout(5.0)
            connection.sendall(f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
            return connection.recv(100).startswith(b"HTTP/1.1 200")
    except OSError:
        return False


def start(checkout: Path, *words: str, page: bool) -> tuple[dict[str, float], list[str]]:
    """One start of `play` with these words; s until the first tick, its CPU time, s until the page, and the files."""
    port = free_port()
    shown = ("--port", str(port)) if page else ("--headless",)
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder, "tick")
        began = time.monotonic()
        process = subprocess.Popen(
            [sys.executable, "-c", _TO_THE_FIRST_TICK, str(out), "play", *words, *shown, "--command-port", "0"],
            env=environment(checkout),
            cwd=checkout,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        replied = None
        try:
            while not out.exists() or (page and replied is None):
                if page and replied is None and answers(port):
                    replied = time.monotonic() - began
                if time.monotonic() > began + PATIENCE:
                    raise RuntimeError("it does not start")
                time.sleep(0.002)
        finally:
            process.kill()
            process.wait()
        ticked, used, *files = out.read_text().splitlines()
    kind = "tick with page" if page else "tick"
    found = {kind: float(ticked) - began, f"{kind}, CPU": float(used)}
    return found | ({"page": replied} if replied is not None else {}), files


def imports(checkout: Path) -> dict[str, float]:
    """How long `import motiondeck` takes, s."""
    took = []
    for program in ("pass", "import motiondeck"):
        began = time.monotonic()
        subprocess.run([sys.executable, "-c", program], env=environment(checkout), cwd=checkout, check=True)
        took.append(time.monotonic() - began)
    return {"import": took[1] - took[0]}


def forget(files: list[str]) -> None:
    """Throws files out of the system's cache; those that a process has mapped stay in part."""
    for name in files:
        try:
            file = os.open(name, os.O_RDONLY)
        except OSError:
            continue
        os.posix_fadvise(file, 0, 0, os.POSIX_FADV_DONTNEED)
        os.close(file)


def main(
    runs: Annotated[int, typer.Option("--runs", help="Starts of each kind; the median is reported.")] = 10,
    beside: Annotated[Path | None, typer.Option("--beside", help="Another checkout, measured in turn.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object.")] = False,
) -> None:
    checkouts = {"this": HERE} | ({"beside": beside.resolve()} if beside is not None else {})
    rows: dict[str, dict[str, list[float]]] = {}
    files = {name: start(checkout, page=False)[1] for name, checkout in checkouts.items()}
    for kind in ("warm", "cold"):
        for _ in range(runs):
            for name, checkout in checkouts.items():
                if kind == "cold":
                    forget(files[name])
                for found in (
                    imports(checkout),
                    start(checkout, page=False)[0],
                    start(checkout, page=True)[0] if kind == "warm" else {},
                ):
                    for what, seconds in found.items():
                        rows.setdefault(f"{what}, {kind}", {}).setdefault(name, []).append(seconds)
    if as_json:
        print(json.dumps({"runs": runs, "load": os.getloadavg()[0], "s": rows}))
        return
    print(f"{runs} starts of each kind, load {os.getloadavg()[0]:.1f}; median (least) in s\n")
    print("| from the command to | " + " | ".join(checkouts) + " |" + (" ratio |" if beside else ""))
    print("|---" * (len(checkouts) + 1 + (beside is not None)) + "|")
    for what, found in rows.items():
        middle = {name: float(np.median(seconds)) for name, seconds in found.items()}
        cells = [f"{middle[name]:.2f} ({min(seconds):.2f})" for name, seconds in found.items()]
        ratio = [f"{middle['this'] / middle['beside']:.2f}"] if beside is not None else []
        print(f"| {what} | " + " | ".join(cells + ratio) + " |")


if __name__ == "__main__":
    run("startup", main, __doc__)
