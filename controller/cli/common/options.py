"""Options that several commands share."""

from __future__ import annotations

PAGE_PORT = 8040
