"""Ball catching (3.3.1): a robot that learned from a thrower whom five modalities watch."""
