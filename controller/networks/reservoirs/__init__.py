"""What several kinds of networks share: reservoirs, conceptor algebra, phase."""
