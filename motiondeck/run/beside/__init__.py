"""Processes beside a run: page, recorder, part in a show; the run plays on without them."""
