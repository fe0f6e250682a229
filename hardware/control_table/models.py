"""The servo models whose control tables are known."""

from __future__ import annotations

from hardware.control_table.table import ControlTable
from hardware.control_table.xm430_w350 import XM430_W350

MODELS: dict[str, ControlTable] = {table.model: table for table in (XM430_W350,)}
