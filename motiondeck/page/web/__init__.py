"""Parts of the page that viser has no widget for: they are drawn in the browser from a little JSON."""
