"""The page of a show of many decks: its state in one line, a card for each deck, and the cue list."""
