"""One run of the deck: everything it opens, and the processes beside it."""
