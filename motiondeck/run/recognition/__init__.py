"""What a run recognizes: motions of the joints or of the whole body, and mismatches with what is played."""
