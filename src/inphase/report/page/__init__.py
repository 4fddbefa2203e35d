"""The report as a page: one HTML file that opens from disk and contacts nothing."""
