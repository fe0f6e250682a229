"""Many decks in one show: how they find each other, share a clock, take cues and stop together."""
