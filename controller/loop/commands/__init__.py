"""Commands of clients, carried out on a run in its loop."""
