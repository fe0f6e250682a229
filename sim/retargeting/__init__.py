"""Retargeting: from human poses to a robot's joints and root."""
