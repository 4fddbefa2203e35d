"""Pictures for papers and notebooks, one file each: a matplotlib Figure in the hand, nothing shown and nothing kept."""
