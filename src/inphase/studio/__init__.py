"""A local page for the whole way from recordings to a model in use; its actions are command lines of inphase.

Its modules need bokeh, and are imported only by `inphase studio`.
"""
