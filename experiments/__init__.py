"""The studies of the dissertation, made again: a folder each, run by `inphase experiment NAME`."""
