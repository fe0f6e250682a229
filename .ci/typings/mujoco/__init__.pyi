# MuJoCo's names come from compiled modules without type stubs; without this file pyright would know none of them.
from typing import Any

def __getattr__(name: str) -> Any: ...
