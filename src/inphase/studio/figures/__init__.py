"""Figures of the studio: values in, a bokeh figure out; one idea a file. Each knows nothing of servers or files."""
