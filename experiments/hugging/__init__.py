"""Whole-body hugging (3.2, 3.3.2): a padded robot of two arms and 61 force sensors, and people who hug it."""
