"""Bodies that studies share: a robot's arm, and a person."""
