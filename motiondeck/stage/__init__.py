"""A stage's signals as a client of a deck: OSC in and out, MIDI notes, clock and timecode."""
