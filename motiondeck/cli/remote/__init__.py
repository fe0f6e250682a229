"""Commands to a deck that runs elsewhere: from a shell, a gamepad, OSC and MIDI."""
