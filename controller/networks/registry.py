"""The kinds of networks: each is a folder beside this file whose `network.py` names its class KIND.

Adding one needs no entry anywhere: its tag is the folder's name with hyphens, "phase-conceptor" for phase_conceptor.
"""

from functools import cache
from importlib import import_module
from pathlib import Path

from controller.networks.base import AnyNetwork
from motiondeck_base.errors import UnknownNameError


@cache
def network_kinds() -> tuple[str, ...]:
    """The tags of all kinds."""
    return tuple(sorted(path.parent.name.replace("_", "-") for path in Path(__file__).parent.glob("*/network.py")))


@cache
def network_kind(tag: str) -> type[AnyNetwork]:
    """The class of a kind; only its own files are imported. UnknownNameError for an unknown kind names the nearest."""
    UnknownNameError.check("kind of network", tag, network_kinds())
    kind: type[AnyNetwork] = import_module(f"controller.networks.{tag.replace('-', '_')}.network").KIND
    return kind
