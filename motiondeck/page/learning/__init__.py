"""Learning a recording on the page: dropped, trimmed, named, learned, played."""
