"""Commands of a show: many decks in step."""
